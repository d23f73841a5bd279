//! Blocking: subtasks that keep their core once started ("limited preemption").
//!
//! This module bounds the lower-ranked work for which such subtasks may have to wait, in a safe
//! form derived for this project.
//!
//! Let `Delta(x)` be the sum of the `x` largest lower-ranked subtasks of other DAGs. While a
//! subtask of the job waits, nothing lower starts. Any lower-ranked work already running was
//! started before the subtask became ready: on at most `m` cores for a source, and on at most
//! `m - 1` for a later subtask, because its predecessor's core has just become free. A subtask
//! never overlaps with itself, so the running subtasks are all different. On `m - j` cores then
//!
//! - at most `Delta(m - j) + N Delta(m - max(j, 1))` blocks, with `N` the number of the DAG's
//!   subtasks with a predecessor: each stretch of waiting except the first begins when such a
//!   subtask becomes ready;
//! - for `j = 0`, unless clipped, at most `Delta(m) + (P - 1) Delta(m - 1)`, with `P` the most
//!   subtasks on a path. The critical chain of `pipelined` gives this bound: only the chain's own
//!   subtasks wait.
//!
//! Trap: the published LP-max bound (M. A. Serrano et al., "Response-Time Analysis of DAG Tasks
//! under Fixed Priority Scheduling with Limited Preemptions", DATE 2016) counts blocking after the
//! first subtask only for preemptions by higher-priority work. But a DAG's own serial phases leave
//! cores idle, and idle cores admit new lower-priority subtasks without any preemption. In the unit
//! test below the published bound gives 10, while 11 is observed.
//!
//! Under EDF a job of any other DAG may have the later deadline, whatever the relative deadlines,
//! because the other DAG may be released during this job. So `Delta` is over all other DAGs. An
//! instance starting while a subtask waits is due no later than the subtask. Such an instance is
//! part of the interference, up to the job's deadline or up to a sink's.
//!
//! Assumes: *no* subtask of any DAG is ever preempted, and the scheduler is work-conserving.

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
    /// The number of its subtasks with a predecessor.
    later: u128,
}

impl Blocking {
    /// Returns the terms of a DAG that nothing blocks.
    pub(super) fn none(task: &Task) -> Self {
        Self {
            largest: Vec::new(),
            path: task.most_subtasks_on_a_path().into(),
            later: (task.subtask_count() - task.sources().len()) as u128,
        }
    }

    /// Returns the blocking of the same DAG by subtasks of these WCETs.
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

    /// Returns the blocking on `cores - j` cores, in the window unless `is_clipped`.
    pub(super) fn during(&self, cores: usize, j: usize, is_clipped: bool) -> u128 {
        if j == 0 && !is_clipped {
            return self.along_a_chain(cores, 0);
        }
        let again = self.later.saturating_mul(self.sum(cores - j.max(1)));
        self.sum(cores - j).saturating_add(again)
    }

    /// Returns the blocking of a critical chain across `back` releases.
    pub(super) fn along_a_chain(&self, cores: usize, back: u128) -> u128 {
        let again = (self.path + back).saturating_sub(1);
        let again = again.saturating_mul(self.sum(cores - 1));
        self.sum(cores).saturating_add(again)
    }
}

/// Returns the largest WCETs, at most as many as there are cores, the largest first.
pub(super) fn largest(wcets_ns: &[u64], cores: u32) -> Vec<u64> {
    let cores = usize::try_from(cores).unwrap_or(usize::MAX);
    let ascending = sorted(wcets_ns);
    ascending.into_iter().rev().take(cores).collect()
}
