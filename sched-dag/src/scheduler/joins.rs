//! The AND-joins of one DAG (R2).
//!
//! Jobs in flight are known by *sequence number*: the how-manieth released job
//! it is. Skipped jobs have none, so the sequence has no gaps, and the job
//! before the one with number s is the one with number s - 1. A job's *slot* is
//! its sequence number modulo the jobs in flight.
//!
//! Each slot has a counter for each subtask: the predecessors that have not
//! finished yet, and for a source the release. Each subtask has its *progress*:
//! the sequence number of the job that it has to do next. An instance (s, v) is
//! ready when its counter is 0 and v's progress is s. Whichever of both comes
//! last makes it ready, exactly once.
//!
//! A counter returns to its initial value when its instance ends, long before
//! the slot's next job is released; so a release touches sources only, and an
//! end touches successors only.

use alloc::boxed::Box;
use alloc::vec;

use crate::ids::{SubtaskId, to_u32};
use crate::task_set::Dag;

/// Counters and progress of one DAG's subtasks.
#[derive(Debug)]
pub(super) struct Joins {
    /// For each slot one counter a subtask.
    counters: Box<[u32]>,
    initial: Box<[u32]>,
    progress: Box<[u64]>,
    in_flight: u64,
}

impl Joins {
    pub(super) fn new(dag: &Dag) -> Self {
        let count = dag.subtasks().len();
        let initial: Box<[u32]> = (0..to_u32(count))
            .map(|subtask| to_u32(dag.predecessors(SubtaskId(subtask)).len().max(1)))
            .collect();
        Self {
            counters: initial.repeat(dag.in_flight() as usize).into_boxed_slice(),
            initial,
            progress: vec![0; count].into_boxed_slice(),
            in_flight: u64::from(dag.in_flight()),
        }
    }

    /// Returns the sequence number of the job that a subtask has to do next, or
    /// is doing.
    pub(super) fn progress(&self, subtask: SubtaskId) -> u64 {
        self.progress[subtask.index()]
    }

    /// Releases a source in a job and reports whether it is ready.
    pub(super) fn release(&mut self, sequence: u64, source: SubtaskId) -> bool {
        self.arrive(sequence, source)
    }

    /// Ends the instance that a subtask is doing, calls `ready` for each
    /// instance that thereby is ready, and returns its sequence number.
    ///
    /// `released` is the sequence number of the next job to be released. The
    /// argument of `ready` is the subtask; its progress tells the job.
    pub(super) fn end(
        &mut self,
        dag: &Dag,
        subtask: SubtaskId,
        released: u64,
        mut ready: impl FnMut(&Self, SubtaskId),
    ) -> u64 {
        let sequence = self.progress[subtask.index()];
        let counter = self.counter(sequence, subtask);
        self.counters[counter] = self.initial[subtask.index()];
        self.progress[subtask.index()] = sequence + 1;
        for &successor in dag.successors(subtask) {
            if self.arrive(sequence, successor) {
                ready(self, successor);
            }
        }
        let next = sequence + 1;
        if next < released && self.counters[self.counter(next, subtask)] == 0 {
            ready(self, subtask);
        }
        sequence
    }

    /// Counts one predecessor, or the release, of an instance, and reports
    /// whether it is ready.
    fn arrive(&mut self, sequence: u64, subtask: SubtaskId) -> bool {
        let counter = self.counter(sequence, subtask);
        self.counters[counter] -= 1;
        self.counters[counter] == 0 && self.progress[subtask.index()] == sequence
    }

    fn counter(&self, sequence: u64, subtask: SubtaskId) -> usize {
        slot(sequence, self.in_flight) * self.initial.len() + subtask.index()
    }
}

/// Returns the slot of a sequence number.
pub(super) fn slot(sequence: u64, in_flight: u64) -> usize {
    // The remainder is less than `in_flight`, which came from a u32.
    #[allow(clippy::cast_possible_truncation)]
    {
        (sequence % in_flight) as usize
    }
}
