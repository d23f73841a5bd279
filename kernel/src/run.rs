//! What a run leaves behind.

use sched_dag::record::{Record, Violation};
use sched_dag::{DagId, DagStatistics, TaskSet};

use crate::execution::{Execution, Snapshot};

/// A run that has ended: its model, its times and its counts.
pub struct Run {
    execution: Execution,
    allocations: u64,
    lock_acquisitions: u32,
    epoch_ns: u64,
}

impl core::fmt::Debug for Run {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Run")
            .field("allocations", &self.allocations)
            .finish_non_exhaustive()
    }
}

impl Run {
    pub(crate) const fn new(
        execution: Execution,
        allocations: u64,
        lock_acquisitions: u32,
        epoch_ns: u64,
    ) -> Self {
        Self {
            execution,
            allocations,
            lock_acquisitions,
            epoch_ns,
        }
    }

    /// Returns the model that was run.
    #[must_use]
    pub fn task_set(&self) -> &TaskSet {
        self.execution.task_set()
    }

    /// Returns the times of all jobs and instances, in nanoseconds from the
    /// instant from which releases count.
    #[must_use]
    pub const fn record(&self) -> &Record {
        self.execution.record()
    }

    /// Returns the instant from which releases count, in nanoseconds since the
    /// kernel's entry.
    #[must_use]
    pub const fn epoch_ns(&self) -> u64 {
        self.epoch_ns
    }

    /// Returns a DAG's counters.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[must_use]
    pub fn statistics(&self, dag: DagId) -> &DagStatistics {
        self.execution.scheduler().statistics(dag)
    }

    /// Returns how a DAG has ended.
    pub(crate) fn snapshot(&self, dag: DagId) -> Snapshot {
        Snapshot::of(self.execution.scheduler(), dag)
    }

    /// Returns every breach of the model's rules.
    pub fn violations(&self) -> impl Iterator<Item = Violation> {
        sched_dag::record::violations(self.task_set(), self.record())
    }

    /// Returns how often anything, kernel or app, allocated memory between the
    /// start of the run and its last completion.
    #[must_use]
    pub const fn allocations(&self) -> u64 {
        self.allocations
    }

    /// Returns how often the scheduler's lock was taken between the start of the
    /// run and its last completion, modulo 2^32.
    #[must_use]
    pub const fn lock_acquisitions(&self) -> u32 {
        self.lock_acquisitions
    }
}
