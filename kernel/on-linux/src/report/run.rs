//! What a run leaves behind, as an app of the kernel sees it.

use std::cell::OnceCell;

use sched_dag::law::{Record, Tally, Violation};
use sched_dag::{DagId, DagStatistics, Journal, SchedulerOptions, SubtaskId, TaskSet};

/// A run that has ended: its model, its times and its counts.
#[derive(Debug)]
pub struct Run {
    run: linux::Run,
    times: OnceCell<Option<Tally>>,
}

impl Run {
    pub(crate) const fn new(run: linux::Run) -> Self {
        Self {
            run,
            times: OnceCell::new(),
        }
    }

    /// Returns the model that was run.
    #[must_use]
    pub fn task_set(&self) -> &TaskSet {
        self.run.task_set()
    }

    /// Returns the times of all jobs and instances, in nanoseconds from the instant from which
    /// releases count; of the latest whole jobs if there was no memory for all events.
    #[must_use]
    pub const fn record(&self) -> &Record {
        self.run.record()
    }

    /// Returns the statistics of all jobs and instances; `None` if some were not recorded.
    #[must_use]
    pub fn times(&self) -> Option<&Tally> {
        let tally = || self.journal().statistics(self.run.task_set());
        self.times.get_or_init(tally).as_ref()
    }

    /// Returns counts and maxima of all times, in less memory.
    pub(crate) fn counts(&self) -> Option<Tally> {
        self.journal().coarse_statistics(self.run.task_set())
    }

    pub(crate) const fn journal(&self) -> &Journal {
        self.run.journal()
    }

    /// Returns the instant from which releases count, on the clock of [`fass::now_ns`].
    #[must_use]
    pub const fn epoch_ns(&self) -> u64 {
        self.run.epoch_ns()
    }

    /// Returns a DAG's counters.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[must_use]
    pub fn statistics(&self, dag: DagId) -> &DagStatistics {
        self.run.statistics(dag)
    }

    /// Returns how many jobs a sink has missed its deadline in.
    #[must_use]
    pub fn sink_misses(&self, dag: DagId, sink: SubtaskId) -> u64 {
        self.run.sink_misses(dag, sink)
    }

    /// Returns how the scheduler was told to work.
    pub(crate) const fn options(&self) -> SchedulerOptions {
        self.run.options()
    }

    /// Returns the response time that the commit has proven for a sink, if it has.
    pub(crate) fn sink_bound_ns(&self, dag: DagId, sink: SubtaskId) -> Option<u64> {
        self.run.sink_bound_ns(dag, sink)
    }

    /// Returns the response time that the commit has proven for a DAG, if it has.
    pub(crate) fn bound_ns(&self, dag: DagId) -> Option<u64> {
        self.run.bound_ns(dag)
    }

    /// Returns every breach of the model's rules R1 to R4, and whether each instance had one
    /// life and each core one instance at a time.
    pub fn violations(&self) -> impl Iterator<Item = Violation> {
        self.run.violations()
    }

    /// Returns every breach of R5 that lasts for longer than `bound_ns`. `None` if events are
    /// lost.
    #[must_use]
    pub fn dispatch_violations(&self, bound_ns: u64) -> Option<Vec<Violation>> {
        self.run.dispatch_violations(bound_ns)
    }

    /// Returns how often anything in the program allocated memory between the start of the run
    /// and its last completion.
    #[must_use]
    pub const fn allocations(&self) -> u64 {
        self.run.allocations()
    }
}
