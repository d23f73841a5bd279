//! The check of a table: the conditions under which no entry is ever late, in one pass over the
//! lists.
//!
//! This is the function proven in Coq (`docs/bounds.md`, "Tables"), written again in Rust: three
//! loops and a map. The check trusts nothing in a table, neither times nor depths. An accepted
//! table is *right*: whatever ends early, is skipped or cut, each entry finishes by its time in the
//! table.
//!
//! The lap after the first has the same entries in the same order, one lap later. The *family* of
//! an entry is the entry itself together with all directly following entries of greater depth. Of
//! each entry:
//!
//! - it starts no earlier than its release, and no earlier than the entry before;
//! - its length covers the WCETs of its family, and ends by the start of the entry after the
//!   family;
//! - nothing is nested in a subtask that keeps its core;
//! - its predecessors, and the same subtask of the job before, start before it and end by its
//!   start.
//!
//! Each subtask has one entry for each job of a lap. WCETs are above 0, as in every [`Task`].

use alloc::vec;
use alloc::vec::Vec;

use super::task::Task;
use crate::ids::{DagId, SubtaskId, to_u32};
use crate::table::{CoreList, Table, TableEntry};
use crate::worded::texts;

/// A DAG of a table.
pub struct TableDag<'a> {
    /// The DAG.
    pub id: DagId,
    /// The DAG's WCETs, with all charges, and its edges.
    pub task: &'a Task,
    /// The release of job 0 in nanoseconds; 0 for a DAG alone in its table.
    pub offset_ns: u64,
    /// By subtask, whether it keeps its core once started.
    pub keeps_core: Vec<bool>,
}

/// An entry failing a condition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TableFault {
    /// The DAG of the entry.
    pub dag: DagId,
    /// The subtask of the entry.
    pub subtask: SubtaskId,
    /// The job of the entry in the first lap.
    pub job: i64,
    /// The failed condition.
    pub condition: TableCondition,
}

/// The times of a right table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TableTimes {
    /// By DAG and subtask, the latest finish of an entry after its release, in nanoseconds.
    pub latest_ns: Vec<Vec<u64>>,
    /// Whether each length equals the WCETs of the family, with all nested entries ending by then.
    /// The table is then a possible run.
    pub is_exact: bool,
}

texts! {
    /// A condition of a table, worded as a failure.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum TableCondition {
        /// Each job of a lap has one entry for each subtask.
        Once = "has no entry of its own";
        /// No entry starts before its release.
        Released = "starts before its release";
        /// Entries start in the order of the list.
        InOrder = "starts after the next entry of its core";
        /// A length covers the WCETs of a family.
        Long = "has less time than the WCETs of it and of all nested in it, with their charges, take";
        /// A family ends by the start of the next entry.
        Apart = "ends after the next entry of its core that is not nested in it starts";
        /// Nothing is nested in a subtask that keeps its core.
        Kept = "keeps its core, and the next entry is nested in it";
        /// Everything an entry waits for ends by its start.
        Ready = "starts before the end of a predecessor, or of the job before";
        /// An entry belongs to the lap's own job.
        OwnLap = "is of another lap's job, though its DAG is sporadic or steps of the scheduler are long";
    }
}

/// Checks a table, with its DAGs in ascending order of ids.
///
/// # Errors
///
/// The first entry to fail a condition.
pub fn check_table(table: &Table, dags: &[TableDag<'_>]) -> Result<TableTimes, TableFault> {
    let check = TableCheck::of(table, dags)?;
    let mut is_exact = true;
    for list in &table.lists {
        is_exact &= check.list(list)?;
    }
    let mut latest_ns: Vec<Vec<u64>> = Vec::new();
    for dag in dags {
        latest_ns.push(vec![0; dag.task.subtask_count()]);
    }
    for entry in table.lists.iter().flat_map(|list| &list.entries) {
        let finish_ns = check.entry(entry)?;
        let of_dag = &mut latest_ns[check.place(entry)?];
        let latest_ns = &mut of_dag[entry.subtask.index()];
        *latest_ns = (*latest_ns).max(finish_ns);
    }
    Ok(TableTimes {
        latest_ns,
        is_exact,
    })
}

/// The most instances of a lap in the map.
const INSTANCE_LIMIT: u32 = 1 << 17;

struct TableCheck<'a> {
    table: &'a Table,
    dags: &'a [TableDag<'a>],
    /// By DAG, the number of its jobs in a lap, and the number of instances of the DAGs before.
    jobs: Vec<(u32, usize)>,
    /// The map from the instances of a lap to their entries.
    entries: Vec<Option<&'a TableEntry>>,
}

impl<'a> TableCheck<'a> {
    /// Maps each instance of a lap to its entry.
    fn of(table: &'a Table, dags: &'a [TableDag<'a>]) -> Result<Self, TableFault> {
        let (mut jobs, mut count) = (Vec::new(), 0_usize);
        for dag in dags {
            let in_lap = u32::try_from(table.lap_ns / dag.task.period_ns());
            let in_lap = in_lap.unwrap_or(u32::MAX);
            jobs.push((in_lap, count));
            count = count.saturating_add(dag.task.subtask_count().saturating_mul(in_lap as usize));
            let is_whole = table.lap_ns.is_multiple_of(dag.task.period_ns());
            if in_lap == 0 || !is_whole || count > INSTANCE_LIMIT as usize {
                return Err(missing(dag, 0, 0));
            }
        }
        let entries = vec![None; count];
        let mut check = Self {
            table,
            dags,
            jobs,
            entries,
        };
        for entry in table.lists.iter().flat_map(|list| &list.entries) {
            let dag = check.place(entry)?;
            let at = check.at(dag, entry.job, entry.subtask.index());
            // A job after the first lap's jobs would leave out the first jobs.
            let is_later = |job| job >= i64::from(check.jobs[dag].0);
            if check.on_grid(dag, entry.job).is_none_or(is_later)
                || check.entries[at].replace(entry).is_some()
            {
                return Err(entry.fails(TableCondition::Once));
            }
        }
        for (dag, &(in_lap, first)) in dags.iter().zip(&check.jobs) {
            let count = dag.task.subtask_count();
            for at in 0..in_lap as usize * count {
                if check.entries[first + at].is_none() {
                    return Err(missing(dag, to_u32(at / count), to_u32(at % count)));
                }
            }
        }
        Ok(check)
    }

    /// Returns the position of the entry's DAG, after checking that the DAG has the entry's
    /// subtask.
    fn place(&self, entry: &TableEntry) -> Result<usize, TableFault> {
        let mut dags = self.dags.iter();
        let has = |dag: &TableDag<'_>| entry.subtask.index() < dag.task.subtask_count();
        let found = dags.position(|dag| dag.id == entry.dag && has(dag));
        found.ok_or(entry.fails(TableCondition::Once))
    }

    /// Returns the number of a job, counted from the first release of its grid in lap 0.
    fn on_grid(&self, dag: usize, job: i64) -> Option<i64> {
        let TableDag {
            task, offset_ns, ..
        } = &self.dags[dag];
        job.checked_add_unsigned(offset_ns / task.period_ns())
    }

    fn at(&self, dag: usize, job: i64, subtask: usize) -> usize {
        let (in_lap, first) = self.jobs[dag];
        let count = self.dags[dag].task.subtask_count();
        let job = usize::try_from(job.rem_euclid(in_lap.into())).unwrap_or(0);
        first + job * count + subtask
    }

    /// Checks the order of a list over two laps, and reports whether the list is a possible run.
    fn list(&self, list: &CoreList) -> Result<bool, TableFault> {
        let (entries, count) = (&list.entries, list.entries.len());
        let start = |at: usize| {
            let laps = (at / count) as u64;
            u128::from(entries[at % count].start_ns) + u128::from(laps * self.table.lap_ns)
        };
        let mut is_exact = true;
        for (at, entry) in entries.iter().enumerate() {
            let (next, mut after) = (&entries[(at + 1) % count], at + 1);
            let length_ns = u128::from(entry.length_ns);
            let mut family_ns = u128::from(self.wcet_ns(entry)?);
            // The loop ends at the latest with the entry itself, one lap later.
            while entries[after % count].depth > entry.depth {
                let nested = &entries[after % count];
                family_ns += u128::from(self.wcet_ns(nested)?);
                is_exact &= start(after) + u128::from(nested.length_ns) <= start(at) + length_ns;
                after += 1;
            }
            is_exact &= length_ns == family_ns;
            let dag = &self.dags[self.place(entry)?];
            let failed = if start(at) > start(at + 1) {
                TableCondition::InOrder
            } else if length_ns < family_ns {
                TableCondition::Long
            } else if start(at) + length_ns > start(after) {
                TableCondition::Apart
            } else if dag.keeps_core[entry.subtask.index()] && next.depth > entry.depth {
                TableCondition::Kept
            } else {
                continue;
            };
            return Err(entry.fails(failed));
        }
        Ok(is_exact)
    }

    fn wcet_ns(&self, entry: &TableEntry) -> Result<u64, TableFault> {
        let dag = &self.dags[self.place(entry)?];
        Ok(dag.task.wcets_ns()[entry.subtask.index()])
    }

    /// Checks everything an entry waits for, and returns its finish after its release, in
    /// nanoseconds.
    fn entry(&self, entry: &TableEntry) -> Result<u64, TableFault> {
        let place = self.place(entry)?;
        let dag = &self.dags[place];
        let period_ns = i128::from(dag.task.period_ns());
        let release_ns = i128::from(dag.offset_ns) + i128::from(entry.job) * period_ns;
        let waiting_ns = i128::from(entry.start_ns) - release_ns;
        let Ok(waiting_ns) = u64::try_from(waiting_ns) else {
            return Err(entry.fails(TableCondition::Released));
        };
        let before = dag.task.graph.predecessors.neighbours(entry.subtask);
        let mut before = before.iter().map(|before| (before.index(), entry.job));
        let own = entry.job.checked_sub(1);
        let own = own.map(|job| (entry.subtask.index(), job));
        let is_over = |(subtask, job)| self.is_over(entry, place, subtask, job);
        match before.all(is_over) && own.is_some_and(is_over) {
            true => Ok(waiting_ns.saturating_add(entry.length_ns)),
            false => Err(entry.fails(TableCondition::Ready)),
        }
    }

    /// Reports whether an instance starts before an entry and finishes by the entry's start.
    fn is_over(&self, entry: &TableEntry, dag: usize, subtask: usize, job: i64) -> bool {
        let Some(before) = self.entries[self.at(dag, job, subtask)] else {
            return false;
        };
        let Some(jobs) = job.checked_sub(before.job) else {
            return false;
        };
        let laps = jobs / i64::from(self.jobs[dag].0);
        let shift_ns = i128::from(laps) * i128::from(self.table.lap_ns);
        let start_ns = i128::from(before.start_ns) + shift_ns;
        let now_ns = i128::from(entry.start_ns);
        start_ns < now_ns && start_ns + i128::from(before.length_ns) <= now_ns
    }
}

impl TableEntry {
    pub(super) fn fails(&self, condition: TableCondition) -> TableFault {
        TableFault {
            dag: self.dag,
            subtask: self.subtask,
            job: self.job,
            condition,
        }
    }
}

fn missing(dag: &TableDag<'_>, job: u32, subtask: u32) -> TableFault {
    TableFault {
        dag: dag.id,
        subtask: SubtaskId(subtask),
        job: job.into(),
        condition: TableCondition::Once,
    }
}
