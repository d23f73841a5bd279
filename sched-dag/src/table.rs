//! Tables: an enforced order on each of some cores, for one DAG or several, over their hyperperiod.
//!
//! A core in a table runs the *entries* of its list, in order and again from the first: each lap of
//! the list is one hyperperiod of the table's DAGs. An entry is a subtask in one job. An entry of
//! *depth* d starts on top of d begun and unfinished entries of its core, or fewer if some of these
//! are void or over. The entries of greater depth directly following an entry are *nested* in it.
//!
//! The scenarios of the rules, in `tests/scenarios/tables.txt`, bear their numbers:
//!
//! - **T1, in place.** An entry starts only on its core, when all entries before it on the list
//!   have started or been passed, and when the innermost begun entry there has a smaller depth;
//!   then as soon as the entry is ready (R2). Anything else running on the core gives way at once,
//!   unless it keeps its core.
//! - **T2, voids.** An entry is void if its job does not exist, was skipped, or was cut before the
//!   entry started. A void entry is passed where it might start.
//! - **T3, nested.** An entry that finishes leaves its core to the next entry, if that may start by
//!   T1, otherwise to the innermost entry begun and not finished.
//! - **T4, members.** An instance of a DAG without a table executes only on a core of its DAG's
//!   *group*: the cores of the DAG's affinity, or all cores of the cluster if no affinity is
//!   stated. The group's cores without a begun and unfinished entry execute the group's instances
//!   with the smallest keys. An instance that has to give way to an entry takes the core of the
//!   least urgent of its group, if its own key is smaller, or an idle core. A core left idle by its
//!   group is not taken by another group. An instance that keeps its core keeps the core also from
//!   entries.
//!
//! If a table is *right*, no entry starts or finishes later than in the table, whatever ends early,
//! is skipped or cut: `docs/bounds.md`, "Tables".

use alloc::boxed::Box;
use alloc::vec::Vec;

use crate::ids::{ClusterId, DagId, SubtaskId};
use crate::order::sorted;

/// The most entries of a table.
pub const ENTRY_LIMIT: usize = 1 << 12;

/// The lists of some cores of one cluster, for the same DAGs.
///
/// Every subtask of the table's DAGs has one entry for each job in a lap. No DAG and no core is in
/// two tables. In a table of a single DAG, which may be sporadic, times count from the release of
/// its job. In a table of several DAGs, which are periodic, times count from the origin of their
/// grids.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Table {
    /// The cluster of the cores.
    pub cluster: ClusterId,
    /// The length of a lap in nanoseconds: the least common multiple of the DAGs' periods.
    pub lap_ns: u64,
    /// The lists, ascending by core, none of them empty.
    pub lists: Box<[CoreList]>,
}

/// The list of one core.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct CoreList {
    /// The core of the cluster, counted from 0.
    pub core: u32,
    /// The entries of one lap, in the order in which they start.
    pub entries: Box<[TableEntry]>,
}

/// A subtask in one job of each lap.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TableEntry {
    /// The DAG.
    pub dag: DagId,
    /// The subtask.
    pub subtask: SubtaskId,
    /// The number of the job in lap 0; each later lap adds the jobs of one lap. A job with a
    /// negative number does not exist.
    pub job: i64,
    /// The number of entries in which the entry is nested.
    pub depth: u32,
    /// The latest start after the beginning of the lap, in nanoseconds, less than the lap. 0 if the
    /// WCETs are not known.
    pub start_ns: u64,
    /// The time from there to the latest finish, in nanoseconds: the WCETs of the entry and of all
    /// entries nested in it. 0 if they are not known.
    pub length_ns: u64,
}

impl Table {
    /// Returns the DAGs, ascending.
    pub fn dags(&self) -> Vec<DagId> {
        let mut dags = sorted(&self.entries().map(|entry| entry.dag).collect::<Vec<_>>());
        dags.dedup();
        dags
    }

    /// Returns the entries of all lists.
    pub fn entries(&self) -> impl Iterator<Item = &TableEntry> {
        self.lists.iter().flat_map(|list| &list.entries)
    }

    /// Reports whether there is only one DAG.
    pub fn is_of_one_dag(&self) -> bool {
        let mut entries = self.entries();
        let first = entries.next().map(|entry| entry.dag);
        entries.all(|entry| Some(entry.dag) == first)
    }

    /// Returns the list of a core of the cluster.
    pub fn list(&self, core: u32) -> Option<&CoreList> {
        self.lists.iter().find(|list| list.core == core)
    }
}
