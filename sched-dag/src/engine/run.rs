//! A run that has ended: its model, its times, its counts, on any platform.

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

/// The response times proven by a commit.
///
/// See [`Run`].
#[derive(Clone, Debug, Default)]
pub struct ProvenBounds {
    /// By DAG.
    pub bounds_ns: Vec<Option<u64>>,
    /// By DAG, the bounds of its sinks, in the order of [`Dag::sinks`](crate::Dag::sinks).
    pub sink_bounds_ns: Vec<Vec<Option<u64>>>,
}

/// The numbers of a run known to its platform.
///
/// See [`Run`].
#[derive(Clone, Copy, Debug, Default)]
pub struct RunCounts {
    /// The origin of release times, on the clock read by functions.
    pub epoch_ns: u64,
    /// The number of memory allocations between the start of the run and its last completion; 0
    /// where nobody counts.
    pub allocations: u64,
    /// The number of acquisitions of the schedulers' locks in that time, modulo 2^32; 0 where
    /// nobody counts.
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
    /// Takes a run out of a finished engine, on `cores` cores in all.
    #[must_use]
    pub fn from_engine<B: SubtaskBody, P>(
        engine: &mut Engine<B, P>,
        proven: ProvenBounds,
        cores: u32,
    ) -> Self {
        let journal = core::mem::take(&mut engine.scheduler.log.journal);
        Self::so_far(engine, journal, cores).with_proven(proven)
    }

    /// Returns the run with the response times proven by the commit.
    #[must_use]
    pub fn with_proven(self, proven: ProvenBounds) -> Self {
        Self { proven, ..self }
    }

    /// Makes a run from an engine that may go on, and from a copy of its journal.
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

    /// Takes over the data of another cluster's engine about the same run.
    pub fn absorb<B: SubtaskBody, P>(&mut self, other: &mut Engine<B, P>) {
        let journal = core::mem::take(&mut other.scheduler.log.journal);
        self.add(other, journal);
    }

    /// Likewise from an engine that may go on, and from a copy of its journal.
    pub(crate) fn add<B: SubtaskBody, P>(&mut self, other: &Engine<B, P>, journal: Journal) {
        let (task_set, cluster) = (&self.task_set, other.cluster);
        let ids = (0..).map(DagId).zip(&mut self.dags);
        // Each scheduler treats the DAGs of other clusters as ended from the start, so its data
        // covers only the DAGs of its own cluster.
        for (dag, of_dag) in ids.filter(|(dag, _)| task_set.dag(*dag).cluster() == cluster) {
            *of_dag = DagCounts::new(&other.scheduler, dag);
        }
        let first_core = task_set.cores_of(cluster, self.options.cores).start;
        // A cluster's scheduler counts its cores from 0, the run counts the cores of the machine.
        self.journal.absorb(journal, cluster, first_core);
    }

    /// Adds the platform's counts.
    #[must_use]
    pub fn with_counts(self, counts: RunCounts) -> Self {
        Self { counts, ..self }
    }

    /// Returns the model of the run.
    pub const fn task_set(&self) -> &Arc<TaskSet> {
        &self.task_set
    }

    /// Returns the times of all jobs and instances, in nanoseconds from the origin of release
    /// times. If there was no memory for all events, the record has only the latest whole jobs.
    ///
    /// Computed from the journal at the first call.
    ///
    /// # Panics
    ///
    /// If there is no memory for the times.
    pub fn record(&self) -> &RunRecord {
        let record = self.try_record();
        record.expect("there is no memory for the times of so many jobs; give the machine more")
    }

    /// Returns the times of all jobs, like [`record`](Self::record). Returns `None` if there is no
    /// memory for them, as after an overload, in which each waiting job counts.
    pub fn try_record(&self) -> Option<&RunRecord> {
        let record = self.record.get_or_init(|| {
            let (is_whole, events) = (self.journal.is_whole(), self.journal.events());
            RunRecord::of_events(&self.task_set, is_whole, events)
        });
        record.as_ref()
    }

    /// Returns the response times of a DAG's complete jobs, in nanoseconds. If there was no memory
    /// for all events, only the latest jobs count.
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

    /// Returns the statistics of all jobs and instances, including jobs whose events made way for
    /// later ones. Returns `None` if some events were neither kept nor counted, mostly because of
    /// `trace_events=0` or the console's `trace off`.
    pub fn times(&self) -> Option<&RunTally> {
        let tally = || self.journal.statistics(&self.task_set, FINEST);
        self.times.get_or_init(tally).as_ref()
    }

    /// Returns counts and maxima of all times, like [`times`](Self::times), in less memory.
    pub fn coarse_times(&self) -> Option<RunTally> {
        self.journal.statistics(&self.task_set, 0)
    }

    /// Returns the journal: the events of the run, in their order.
    pub const fn journal(&self) -> &Journal {
        &self.journal
    }

    /// Returns the origin of release times, in nanoseconds on the clock read by functions.
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

    /// Returns the final state of a DAG.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[track_caller]
    pub fn snapshot(&self, dag: impl DagKey) -> &DagSnapshot {
        &self.dags[self.task_set.find(dag).index()].snapshot
    }

    /// Returns the number of jobs in which a sink has missed its deadline, including jobs not
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

    /// Returns the scheduler's options.
    pub const fn options(&self) -> SchedulerOptions {
        self.options
    }

    /// Returns the response time proven by the commit for a DAG, in nanoseconds, if any.
    #[track_caller]
    pub fn bound_ns(&self, dag: impl DagKey) -> Option<u64> {
        *self.proven.bounds_ns.get(self.task_set.find(dag).index())?
    }

    /// Returns the response time proven by the commit for a sink, in nanoseconds, if any.
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

    /// Returns every breach of the model's rules R1 to R4, of the stated number of waits (W1), of
    /// the order of each instance's events, and of the limit of one instance at a time on each
    /// core, as far as the events kept show. Durations are never breaches, because the machine
    /// decides them.
    pub fn violations(&self) -> impl Iterator<Item = Violation> {
        self.judge(&mut |_| ()).into_iter()
    }

    /// Works like [`violations`](Self::violations), and reports progress: calls `tell` at each
    /// event with the number of events so far.
    #[inline(never)]
    pub fn judge(&self, tell: &mut dyn FnMut(u64)) -> Vec<Violation> {
        let mut count = 0;
        let events = self.journal.events().inspect(|_| {
            count += 1;
            tell(count);
        });
        law::violations(&self.task_set, self.terms(u64::MAX), events)
    }

    /// Returns every breach of R5 (did the right instances run?) lasting longer than `bound_ns`,
    /// because a decision takes effect only when a core has changed over. Returns `None` if events
    /// are lost.
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

    /// Measures one of the commit's chains across DAGs: the age of its outputs, and its reaction
    /// time. If events are lost, only the latest jobs count.
    pub fn latencies(&self, chain: &Chain) -> ChainLatencies {
        chain.latencies(&self.task_set, self.journal.events())
    }

    /// Returns the number of memory allocations between the start of the run and its last
    /// completion; 0 where nobody counts.
    pub const fn allocations(&self) -> u64 {
        self.counts.allocations
    }

    /// Returns the number of acquisitions of the schedulers' locks between the start of the run and
    /// its last completion, modulo 2^32; 0 where nobody counts.
    pub const fn lock_acquisitions(&self) -> u32 {
        self.counts.lock_acquisitions
    }
}
