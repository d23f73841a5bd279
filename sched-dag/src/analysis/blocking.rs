//! Blocking: subtasks that keep their core once started ("limited preemption").
//!
//! The lower-ranked work that they may have to wait for, in a safe form that was derived for this
//! project.
//!
//! Let `Delta(x)` be the sum of the `x` largest lower-ranked subtasks of other DAGs. While a
//! subtask of the job waits, nothing lower starts. Lower-ranked work that it finds was
//! started before it became ready: on at most `m` cores for a source, on at most `m - 1` for
//! a later one, because the core of its predecessor has just become free. A subtask never
//! overlaps with itself, so those running are different subtasks. On `m - j` cores then
//!
//! - at most `Delta(m - j) + N Delta(m - max(j, 1))` blocks, with `N` the number of the DAG's
//!   subtasks that have a predecessor: each stretch of waiting but the first begins when
//!   one of these becomes ready;
//! - for `j = 0`, unless clipped, at most `Delta(m) + (P - 1) Delta(m - 1)`, with `P` the most
//!   subtasks on a path, by the critical chain of `pipelined` instead: only the subtasks of
//!   that one chain wait.
//!
//! Trap: the published LP-max bound (M. A. Serrano et al., "Response-Time
//! Analysis of DAG Tasks under Fixed Priority Scheduling with Limited
//! Preemptions", DATE 2016) counts blocking after the first subtask only for
//! preemptions by higher-priority work. But a DAG's own serial phases leave
//! cores idle, and those admit new lower-priority subtasks without anybody
//! being preempted: in the unit test below that gives 10 and 11 is observed.
//!
//! Under EDF any other DAG's job may have the later deadline, whatever the relative
//! deadlines: it may be released during this job. So `Delta` is over all other DAGs. An
//! instance that starts while a subtask waits is due no later than that, so it is among the
//! interference, be it up to the job's deadline or up to a sink's.
//!
//! Assumes: *no* subtask of any DAG is ever preempted; work-conserving.

use alloc::vec::Vec;

use super::task::Task;
use crate::order::sorted;

/// Lower-ranked work that a job may find on the cores and must wait for.
#[derive(Clone, Debug)]
pub(super) struct Blocking {
    /// The sums of the 1, 2, .. largest subtasks, for as many as there are cores.
    largest: Vec<u128>,
    /// The most subtasks on a path of the blocked DAG.
    path: u128,
    /// Its subtasks that have a predecessor.
    later: u128,
}

impl Blocking {
    /// Returns that of a DAG which nothing blocks.
    pub(super) fn none(task: &Task) -> Self {
        Self {
            largest: Vec::new(),
            path: task.most_subtasks_on_a_path().into(),
            later: (task.subtask_count() - task.sources().len()) as u128,
        }
    }

    /// Returns that of the same DAG by subtasks of these WCETs.
    pub(super) fn by(&self, wcets_ns: &[u64], cores: u32) -> Self {
        let sums = largest(wcets_ns, cores).into_iter().scan(0, |sum, wcet| {
            *sum += u128::from(wcet);
            Some(*sum)
        });
        Self {
            largest: sums.collect(),
            ..*self
        }
    }

    /// Returns the sum of the `count` largest subtasks.
    pub(super) fn sum(&self, count: usize) -> u128 {
        let last = count.min(self.largest.len()).checked_sub(1);
        last.map_or(0, |last| self.largest[last])
    }

    /// Returns the blocking on `cores - j` cores; if not `is_clipped`, in the window.
    pub(super) fn during(&self, cores: usize, j: usize, is_clipped: bool) -> u128 {
        if j == 0 && !is_clipped {
            return self.along_a_chain(cores, 0);
        }
        let again = self.later.saturating_mul(self.sum(cores - j.max(1)));
        self.sum(cores - j).saturating_add(again)
    }

    /// Returns the blocking of a critical chain that crosses `back` releases.
    pub(super) fn along_a_chain(&self, cores: usize, back: u128) -> u128 {
        let again = (self.path + back).saturating_sub(1);
        let again = again.saturating_mul(self.sum(cores - 1));
        self.sum(cores).saturating_add(again)
    }
}

/// Returns the largest WCETs, as many as there are cores at most, the largest first.
pub(super) fn largest(wcets_ns: &[u64], cores: u32) -> Vec<u64> {
    let cores = usize::try_from(cores).unwrap_or(usize::MAX);
    let ascending = sorted(wcets_ns);
    ascending.into_iter().rev().take(cores).collect()
}
