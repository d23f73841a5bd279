//! The times of a run of the evaluation, the same whatever joined.
//!
//! One source, N parallel subtasks, one join. By the DAG of `fork-join` the scheduler joins them;
//! in publish/subscribe form they are callbacks, and a synchronizer matches stamps. Whatever is
//! joined, parallel subtask b executes its i-th job for the same time, which depends on the seed, b
//! and i alone ([`fork_join::ExecutionTimes`]).
//!
//! Nothing here knows the kernel.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

use alloc::vec::Vec;

use pub_sub::workload::{Record, RecordedSet};

/// From when to when something executed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Span {
    /// The function's first instruction.
    pub start_ns: u64,
    /// For the source and the parallel subtasks: the publication. For a join: the
    /// function's last instruction.
    pub finish_ns: u64,
}

/// A join that happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Joined {
    /// When all that is joined had been put together.
    pub ready_ns: u64,
    /// When the function that uses it executed.
    pub span: Span,
}

/// The times of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Samples {
    /// For each job the source's execution.
    pub source: Vec<Span>,
    /// For each parallel subtask and job its execution.
    pub parallel: Vec<Vec<Span>>,
    /// The joins in their order.
    pub joins: Vec<Joined>,
    /// For each join the jobs whose values it joined, one a parallel subtask; all
    /// joins one after the other.
    pub indices: Vec<u64>,
    /// Messages that queues before the synchronizer dropped. More than 0 means that
    /// the i-th publication is not job i.
    pub lost_inputs: u64,
}

impl Samples {
    /// Returns the jobs whose values a join has joined.
    #[must_use]
    pub fn indices_of(&self, join: usize) -> &[u64] {
        let parallel = self.parallel.len();
        &self.indices[join * parallel..(join + 1) * parallel]
    }

    /// Returns what the metrics are computed from.
    #[must_use]
    pub fn record(&self) -> Record {
        let publications = |spans: &Vec<Span>| spans.iter().map(|span| span.finish_ns).collect();
        let to_index = |index: &u64| usize::try_from(*index).unwrap_or(usize::MAX);
        let sets = self
            .joins
            .iter()
            .enumerate()
            .map(|(join, joined)| RecordedSet {
                ready_ns: joined.ready_ns,
                indices: self.indices_of(join).iter().map(to_index).collect(),
            });
        Record {
            publications_ns: self.parallel.iter().map(publications).collect(),
            sets: sets.collect(),
        }
    }
}
