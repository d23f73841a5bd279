//! What a run leaves behind.

use alloc::vec::Vec;
use core::cell::OnceCell;

use sched_dag::chains::{Chain, Latencies};
use sched_dag::law::{Record, Tally, Violation};
use sched_dag::{DagId, DagStatistics, Journal, SchedulerOptions, Snapshot, SubtaskId, TaskSet};

use executive::run::execution::Ended;

/// A run that has ended: its model, its times and its counts.
///
/// ```no_run
/// use kernel::report::{Distribution, Ns};
/// use kernel::{Run, println};
/// use sched_dag::DagId;
///
/// fn report(run: &Run) {
///     for (dag, model) in (0..).map(DagId).zip(run.task_set().dags()) {
///         let jobs = run.record().numbered(dag);
///         let response_times = Distribution::new(jobs.filter_map(|(job, times)| {
///             Some(run.record().completion_ns(dag, job)? - times.release_ns?)
///         }));
///         let misses = run.statistics(dag).misses;
///         println!("{}: at most {}, {misses} misses", model.name(), Ns(response_times.max()));
///     }
///     for violation in run.violations() {
///         println!("{violation}");
///     }
///     println!("{} allocations", run.allocations());
/// }
/// ```
pub struct Run {
    ended: Ended,
    record: OnceCell<Record>,
    times: OnceCell<Option<Tally>>,
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
        ended: Ended,
        allocations: u64,
        lock_acquisitions: u32,
        epoch_ns: u64,
    ) -> Self {
        Self {
            ended,
            record: OnceCell::new(),
            times: OnceCell::new(),
            allocations,
            lock_acquisitions,
            epoch_ns,
        }
    }

    /// Returns the model that was run.
    ///
    /// See [`Run`].
    #[must_use]
    pub fn task_set(&self) -> &TaskSet {
        self.ended.task_set()
    }

    /// Returns the times of all jobs and instances, in nanoseconds from the
    /// instant from which releases count; of the latest whole jobs if there was no
    /// memory for all events.
    ///
    /// Computed from the journal when it is asked for first.
    ///
    /// # Panics
    ///
    /// If there is no memory for it.
    ///
    /// See [`Run`].
    #[must_use]
    pub fn record(&self) -> &Record {
        self.record
            .get_or_init(|| self.journal().record(self.task_set()))
    }

    /// Returns the statistics of all jobs and instances, those included whose events
    /// made way for later ones; `None` if some were not recorded, because of
    /// `trace_events=0` or the console's `trace off`.
    ///
    /// ```no_run
    /// use sched_dag::DagId;
    ///
    /// /// The response time that one job in a thousand exceeds.
    /// fn tail_ns(run: &kernel::Run, dag: DagId) -> Option<u64> {
    ///     Some(run.times()?.dag(dag).response_time.per_mille(999))
    /// }
    /// ```
    #[must_use]
    pub fn times(&self) -> Option<&Tally> {
        let tally = || self.journal().statistics(self.ended.task_set());
        self.times.get_or_init(tally).as_ref()
    }

    /// Returns counts and maxima of all times, as [`times`](Self::times) does, in less memory.
    pub(crate) fn counts(&self) -> Option<Tally> {
        self.journal().coarse_statistics(self.ended.task_set())
    }

    pub(crate) fn journal(&self) -> &Journal {
        self.ended.journal()
    }

    /// Returns the instant from which releases count, in nanoseconds since the
    /// kernel's entry.
    ///
    /// ```no_run
    /// /// The time of the first release of a DAG without offset, on `fass::now_ns`'s clock.
    /// fn first_release_ns(run: &kernel::Run) -> u64 {
    ///     run.epoch_ns()
    /// }
    /// ```
    #[must_use]
    pub const fn epoch_ns(&self) -> u64 {
        self.epoch_ns
    }

    /// Returns a DAG's counters.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    ///
    /// See [`Run`].
    #[must_use]
    pub fn statistics(&self, dag: DagId) -> &DagStatistics {
        self.ended.scheduler(dag).statistics(dag)
    }

    /// Returns how many jobs a sink has missed its deadline in, those included that
    /// were not released in time.
    ///
    /// # Panics
    ///
    /// If there is no such DAG, or the subtask is no sink of it.
    ///
    /// ```no_run
    /// use sched_dag::DagId;
    ///
    /// fn print_misses(run: &kernel::Run, dag: DagId) {
    ///     for &sink in run.task_set().dag(dag).sinks() {
    ///         kernel::println!("sink {}: {} misses", sink.0, run.sink_misses(dag, sink));
    ///     }
    /// }
    /// ```
    #[must_use]
    pub fn sink_misses(&self, dag: DagId, sink: SubtaskId) -> u64 {
        self.ended.scheduler(dag).sink_misses(dag, sink)
    }

    /// Returns how the scheduler was told to work.
    pub(crate) fn options(&self) -> SchedulerOptions {
        self.ended.options()
    }

    /// Returns the response time that the commit has proven for a sink, if it has.
    pub(crate) fn sink_bound_ns(&self, dag: DagId, sink: SubtaskId) -> Option<u64> {
        self.ended.sink_bound_ns(dag, sink)
    }

    /// Returns the response time that the commit has proven for a DAG, if it has.
    pub(crate) fn bound_ns(&self, dag: DagId) -> Option<u64> {
        self.ended.bound_ns(dag)
    }

    /// Returns how a DAG has ended.
    pub(crate) fn snapshot(&self, dag: DagId) -> Snapshot {
        self.ended.scheduler(dag).snapshot(dag)
    }

    /// Returns every breach of the model's rules R1 to R4, and whether each instance had
    /// one life and each core one instance at a time. However long something takes is
    /// right, for that is the machine's affair.
    ///
    /// See [`Run`].
    pub fn violations(&self) -> impl Iterator<Item = Violation> {
        self.journal().violations(self.task_set()).into_iter()
    }

    /// Returns every breach of R5 (did the right instances run?) that lasts for longer than
    /// `bound_ns`: a decision takes effect after an interrupt. `None` if events are lost.
    ///
    /// ```no_run
    /// /// How often an instance waited for a core for more than 50 us without need.
    /// fn passed_over(run: &kernel::Run) -> Option<usize> {
    ///     Some(run.dispatch_violations(50_000)?.len())
    /// }
    /// ```
    #[must_use]
    pub fn dispatch_violations(&self, bound_ns: u64) -> Option<Vec<Violation>> {
        self.journal()
            .dispatch_violations(self.task_set(), &self.options(), bound_ns)
    }

    /// Measures a chain that crosses DAGs, one of those of the commit: how old its outputs are,
    /// and how long it takes to react; of the latest jobs if events are lost.
    ///
    /// ```no_run
    /// /// The longest time for which the motor obeyed what a camera saw.
    /// fn longest_ns(run: &kernel::Run, commit: &fass::Commit) -> Option<u64> {
    ///     let ways = commit.chains_between("camera/expose", "motor/drive");
    ///     let of_way = |way: &fass::EndToEnd| run.latencies(&way.chain).data_age_ns.into_iter().max();
    ///     ways.iter().filter_map(of_way).max()
    /// }
    /// ```
    #[must_use]
    pub fn latencies(&self, chain: &Chain) -> Latencies {
        chain.latencies(self.task_set(), self.journal().events())
    }

    /// Returns how often anything, kernel or app, allocated memory between the
    /// start of the run and its last completion.
    ///
    /// See [`Run`].
    #[must_use]
    pub const fn allocations(&self) -> u64 {
        self.allocations
    }

    /// Returns how often the scheduler's lock was taken between the start of the
    /// run and its last completion, modulo 2^32.
    ///
    /// ```no_run
    /// /// How often the lock was taken for each of `completions` completed instances.
    /// fn locks_each(run: &kernel::Run, completions: u32) -> u32 {
    ///     run.lock_acquisitions() / completions
    /// }
    /// ```
    #[must_use]
    pub const fn lock_acquisitions(&self) -> u32 {
        self.lock_acquisitions
    }
}
