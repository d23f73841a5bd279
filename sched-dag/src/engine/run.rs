//! A run that has ended: its model, its times, its counts, on whatever platform.

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::cell::OnceCell;

use super::{Engine, SubtaskBody};
use crate::chains::{Chain, ChainLatencies};
use crate::ids::{DagId, SubtaskId};
use crate::kept::{FINEST, Journal};
use crate::key::{DagKey, SubtaskKey};
use crate::law::{self, JudgeOptions, RunRecord, RunTally, Violation};
use crate::policies::SchedulerOptions;
use crate::scheduler::{DagSnapshot, DagStatistics, Scheduler};
use crate::task_set::TaskSet;

/// A run that has ended: its model, its times and its counts.
///
/// ```no_run
/// use sched_dag::engine::Run;
///
/// fn report(run: &Run) {
///     for dag in run.task_set().dags() {
///         let longest_ns = run.response_times_ns(dag.name()).max();
///         let misses = run.statistics(dag.name()).misses;
///         println!("{}: at most {longest_ns:?} ns, {misses} misses", dag.name());
///     }
///     for violation in run.violations() {
///         println!("{violation}");
///     }
///     println!("{} allocations", run.allocations());
/// }
/// ```
#[derive(Clone, Debug)]
pub struct Run {
    task_set: Arc<TaskSet>,
    options: SchedulerOptions,
    proven: ProvenBounds,
    dags: Vec<DagCounts>,
    journal: Journal,
    record: OnceCell<Option<RunRecord>>,
    times: OnceCell<Option<RunTally>>,
    counts: RunCounts,
}

/// The response times that a commit has proven.
///
/// See [`Run`].
#[derive(Clone, Debug, Default)]
pub struct ProvenBounds {
    /// By DAG.
    pub bounds_ns: Vec<Option<u64>>,
    /// By DAG, of its sinks, in the order of [`Dag::sinks`](crate::Dag::sinks).
    pub sink_bounds_ns: Vec<Vec<Option<u64>>>,
}

/// The numbers of a run that its platform knows.
///
/// See [`Run`].
#[derive(Clone, Copy, Debug, Default)]
pub struct RunCounts {
    /// The instant from which releases count, on the clock that functions read.
    pub epoch_ns: u64,
    /// How often anything allocated memory between the start of the run and its last completion.
    pub allocations: u64,
    /// How often the schedulers' locks were taken meanwhile, modulo 2^32; 0 where nobody counts.
    pub lock_acquisitions: u32,
}

#[derive(Clone, Debug)]
struct DagCounts {
    snapshot: DagSnapshot,
    /// By sink.
    misses: Vec<u64>,
}

impl DagCounts {
    fn new(scheduler: &Scheduler, dag: DagId) -> Self {
        let sinks = scheduler.task_set().dag(dag).sinks().iter();
        Self {
            snapshot: scheduler.snapshot(dag),
            misses: (sinks.map(|sink| scheduler.sink_misses(dag, *sink))).collect(),
        }
    }
}

impl Run {
    /// Takes it out of an engine that has come to its end, on so many cores in all.
    #[must_use]
    pub fn from_engine<B: SubtaskBody, P>(
        engine: &mut Engine<B, P>,
        proven: ProvenBounds,
        cores: u32,
    ) -> Self {
        let journal = core::mem::take(&mut engine.scheduler.log.journal);
        Self::so_far(engine, journal, cores).with_proven(proven)
    }

    /// Returns the same with what the commit has proven.
    #[must_use]
    pub fn with_proven(self, proven: ProvenBounds) -> Self {
        Self { proven, ..self }
    }

    /// Makes one of an engine that may go on, and of a copy of its journal.
    pub(crate) fn so_far<B: SubtaskBody, P>(
        engine: &Engine<B, P>,
        journal: Journal,
        cores: u32,
    ) -> Self {
        let ids = (0..).map(DagId).take(engine.task_set.dags().len());
        Self {
            task_set: Arc::clone(&engine.task_set),
            options: SchedulerOptions {
                cores,
                ..engine.scheduler.options()
            },
            proven: ProvenBounds::default(),
            dags: ids
                .map(|dag| DagCounts::new(&engine.scheduler, dag))
                .collect(),
            journal,
            record: OnceCell::new(),
            times: OnceCell::new(),
            counts: RunCounts::default(),
        }
    }

    /// Takes over what the engine of another cluster has of the same run.
    pub fn absorb<B: SubtaskBody, P>(&mut self, other: &mut Engine<B, P>) {
        let journal = core::mem::take(&mut other.scheduler.log.journal);
        self.add(other, journal);
    }

    /// Takes over the same of an engine that may go on, and of a copy of its journal.
    pub(crate) fn add<B: SubtaskBody, P>(&mut self, other: &Engine<B, P>, journal: Journal) {
        let (task_set, cluster) = (&self.task_set, other.cluster);
        let ids = (0..).map(DagId).zip(&mut self.dags);
        // To each scheduler the DAGs of other clusters are ended from the start: it knows its own
        // only.
        for (dag, of_dag) in ids.filter(|(dag, _)| task_set.dag(*dag).cluster() == cluster) {
            *of_dag = DagCounts::new(&other.scheduler, dag);
        }
        let first_core = task_set.cores_of(cluster, self.options.cores).start;
        // A cluster's scheduler counts its cores from 0, the run counts those of the machine.
        self.journal.absorb(journal, cluster, first_core);
    }

    /// Adds what the platform has counted.
    #[must_use]
    pub fn with_counts(self, counts: RunCounts) -> Self {
        Self { counts, ..self }
    }

    /// Returns the model that was run.
    pub const fn task_set(&self) -> &Arc<TaskSet> {
        &self.task_set
    }

    /// Returns the times of all jobs and instances, in nanoseconds from the instant from which
    /// releases count; of the latest whole jobs if there was no memory for all events.
    ///
    /// Computed from the journal when it is asked for first.
    ///
    /// # Panics
    ///
    /// If there is no memory for it.
    pub fn record(&self) -> &RunRecord {
        let record = self.try_record();
        record.expect("there is no memory for the times of so many jobs; give the machine more")
    }

    /// Returns the times of all jobs, as [`record`](Self::record) does; `None` if there is no memory
    /// for them, as after an overload, in which each job that waits counts.
    pub fn try_record(&self) -> Option<&RunRecord> {
        let record = self.record.get_or_init(|| {
            let (is_whole, events) = (self.journal.is_whole(), self.journal.events());
            RunRecord::of_events(&self.task_set, is_whole, events)
        });
        record.as_ref()
    }

    /// Returns the response times of a DAG's complete jobs, in nanoseconds; of the latest jobs if
    /// there was no memory for all events.
    ///
    /// # Panics
    ///
    /// If there is no such DAG, or no memory for the times.
    #[track_caller]
    pub fn response_times_ns(&self, dag: impl DagKey) -> impl Iterator<Item = u64> {
        let (dag, record) = (self.task_set.find(dag), self.record());
        record.numbered(dag).filter_map(move |(job, times)| {
            let completion_ns = record.completion_ns(dag, job)?;
            Some(completion_ns.saturating_sub(times.release_ns?))
        })
    }

    /// Returns the statistics of all jobs and instances, those included whose events made way for
    /// later ones; `None` if some were not recorded, because of `trace_events=0` or the console's
    /// `trace off`.
    pub fn times(&self) -> Option<&RunTally> {
        let tally = || self.journal.statistics(&self.task_set, FINEST);
        self.times.get_or_init(tally).as_ref()
    }

    /// Returns counts and maxima of all times, as [`times`](Self::times) does, in less memory.
    pub fn coarse_times(&self) -> Option<RunTally> {
        self.journal.statistics(&self.task_set, 0)
    }

    /// Returns the journal: what has happened, in its order.
    pub const fn journal(&self) -> &Journal {
        &self.journal
    }

    /// Returns the instant from which releases count, in nanoseconds on the clock that functions
    /// read.
    pub const fn epoch_ns(&self) -> u64 {
        self.counts.epoch_ns
    }

    /// Returns a DAG's counters.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[track_caller]
    pub fn statistics(&self, dag: impl DagKey) -> &DagStatistics {
        &self.snapshot(dag).statistics
    }

    /// Returns how a DAG has ended.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[track_caller]
    pub fn snapshot(&self, dag: impl DagKey) -> &DagSnapshot {
        &self.dags[self.task_set.find(dag).index()].snapshot
    }

    /// Returns how many jobs a sink has missed its deadline in, those included that were not
    /// released in time.
    ///
    /// # Panics
    ///
    /// If there is no such DAG, or the subtask is no sink of it.
    #[track_caller]
    pub fn sink_misses(&self, dag: impl DagKey, sink: impl SubtaskKey) -> u64 {
        let (dag, sink) = self.find(dag, sink);
        let place = self.place_of(dag, sink);
        let place = place.expect("misses are asked for of a subtask that is no sink");
        self.dags[dag.index()].misses[place]
    }

    /// Returns how the scheduler was told to work.
    pub const fn options(&self) -> SchedulerOptions {
        self.options
    }

    /// Returns the response time that the commit has proven of a DAG, if it has.
    #[track_caller]
    pub fn bound_ns(&self, dag: impl DagKey) -> Option<u64> {
        *self.proven.bounds_ns.get(self.task_set.find(dag).index())?
    }

    /// Returns the response time that the commit has proven of a sink, if it has.
    #[track_caller]
    pub fn sink_bound_ns(&self, dag: impl DagKey, sink: impl SubtaskKey) -> Option<u64> {
        let (dag, sink) = self.find(dag, sink);
        let place = self.place_of(dag, sink)?;
        *self.proven.sink_bounds_ns.get(dag.index())?.get(place)?
    }

    #[track_caller]
    fn find(&self, dag: impl DagKey, subtask: impl SubtaskKey) -> (DagId, SubtaskId) {
        let dag = self.task_set.find(dag);
        (dag, self.task_set.dag(dag).find(subtask))
    }

    fn place_of(&self, dag: DagId, sink: SubtaskId) -> Option<usize> {
        self.task_set.dag(dag).sinks().binary_search(&sink).ok()
    }

    /// Returns every breach of the model's rules R1 to R4, and whether each instance had one life
    /// and each core one instance at a time. However long something takes is right, for that is
    /// the machine's affair.
    pub fn violations(&self) -> impl Iterator<Item = Violation> {
        self.judge(&mut |_| ()).into_iter()
    }

    /// Works like [`violations`](Self::violations), and tells of its progress: how many events it
    /// has come to, at each of them.
    #[inline(never)]
    pub fn judge(&self, tell: &mut dyn FnMut(u64)) -> Vec<Violation> {
        let mut count = 0;
        let events = self.journal.events().inspect(|_| {
            count += 1;
            tell(count);
        });
        law::violations(&self.task_set, self.terms(u64::MAX), events)
    }

    /// Returns every breach of R5 (did the right instances run?) that lasts for longer than
    /// `bound_ns`: a decision takes effect when a core has changed over. `None` if events are lost.
    #[must_use]
    pub fn dispatch_violations(&self, bound_ns: u64) -> Option<Vec<Violation>> {
        let (task_set, events) = (&self.task_set, self.journal.events());
        let terms = self.terms(bound_ns);
        let judge = || law::dispatch_violations(task_set, &self.options, terms, events);
        terms.is_whole.then(judge)
    }

    const fn terms(&self, tolerance_ns: u64) -> JudgeOptions {
        JudgeOptions {
            is_whole: self.journal.is_whole(),
            ..JudgeOptions::whole(tolerance_ns)
        }
    }

    /// Measures a chain that crosses DAGs, one of those of the commit: how old its outputs are,
    /// and how long it takes to react; of the latest jobs if events are lost.
    pub fn latencies(&self, chain: &Chain) -> ChainLatencies {
        chain.latencies(&self.task_set, self.journal.events())
    }

    /// Returns how often anything allocated memory between the start of the run and its last
    /// completion.
    pub const fn allocations(&self) -> u64 {
        self.counts.allocations
    }

    /// Returns how often the schedulers' locks were taken between the start of the run and its
    /// last completion, modulo 2^32; 0 where nobody counts.
    pub const fn lock_acquisitions(&self) -> u32 {
        self.counts.lock_acquisitions
    }
}
