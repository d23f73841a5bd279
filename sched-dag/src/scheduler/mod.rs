//! The scheduler as a pure state machine.
//!
//! It has no clock, no thread and no I/O. A *driver* tells it what has happened
//! and when; it answers with *decisions*. All that it needs is allocated when it
//! is made.
//!
//! # One instant
//!
//! R5 orders what happens at one instant: completions, then releases, then one
//! dispatch that sees both. The types force this order:
//!
//! 1. [`Scheduler::at`] begins the instant and gives a [`Moment`], which takes
//!    completions, signals to sporadic DAGs, and faults and requests to end;
//! 2. [`Moment::dispatch`] ends it: it releases what is due, then gives the [`Decision`]s.
//!
//! A driver calls them when a subtask has returned, and at the latest at
//! [`Scheduler::next_event_ns`].
//!
//! # What it guarantees
//!
//! - The rules R1 to R5 (see the [crate]), with the key that R5 states.
//! - Each job ends exactly once, in the order of its DAG's jobs, and each due
//!   job is released, skipped, or dropped with its DAG's end, exactly once.
//! - Bounded steps: a release costs the sources of its DAG, a completion the
//!   successors of its subtask, a decision the logarithm of the number of
//!   subtasks. Besides, a job that is cut costs its
//!   instances, once; at one instant that is at most the DAG's
//!   subtasks and edges times the jobs that may be in flight. A backlog that is
//!   skipped costs [`SKIPS_A_STEP`] events a step, however long it is. After a
//!   pause of the driver, each release and each deadline that has passed
//!   meanwhile costs its step.
//!
//! # What it does not
//!
//! It does not know execution times: a subtask that never returns keeps its
//! core (or, preempted, its place in line). It does not measure, it believes
//! the driver's times; a time earlier than one before counts as that one.

mod bits;
mod dispatch;
mod groups;
mod instances;
mod jobs;
mod key;
mod lists;
mod log;
mod moment;
mod overrun;
mod phase;
mod ready_queue;
mod signals;
mod timers;
mod vertices;
mod waits;

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::hash::{Hash, Hasher};
use core::ops::Range;

use crate::ids::{ClusterId, CoreId, DagId, Instance, Vertex, to_u32};
use crate::journal::EventKind;
use crate::policies::SchedulerOptions;
use crate::scheduler::dispatch::CoreTable;
use crate::scheduler::groups::ReadyLines;
use crate::scheduler::jobs::JobTable;
use crate::scheduler::phase::SurvivedFaults;
use crate::scheduler::timers::Timers;
use crate::scheduler::vertices::VertexTable;
use crate::scheduler::waits::WaitTable;
use crate::task_set::{Dag, TaskSet};

pub use crate::scheduler::dispatch::{Decision, HandOff, Unwritten};
pub use crate::scheduler::log::{DriverNotice, EventLog};
pub use crate::scheduler::moment::{Moment, TurnEnd};
pub use crate::scheduler::phase::{
    DagPhase, DagSnapshot, SKIPS_A_STEP, SKIPS_EVERY_NS, SchedulerQuery,
};

/// The state of all jobs in flight.
///
/// A copy goes on by itself, as if it had been told all that the original was. Copies of
/// one scheduler that [hash](Hash) alike are taken for the same state: what the task set
/// and the options say is not in the hash.
#[derive(Clone, Debug)]
pub struct Scheduler {
    task_set: Arc<TaskSet>,
    options: SchedulerOptions,
    dags: Box<[DagState]>,
    vertices: VertexTable,
    /// The ready instances that do not run.
    ready: ReadyLines,
    /// How many instances have become ready since the last dispatch, and [`OWED`] if
    /// a core has become idle since then that the next instance in line may need.
    fresh: u32,
    cores: CoreTable,
    /// When something happens to each DAG without a completion, and behind the DAGs, when each
    /// wait ends at the latest, and when skips are told of.
    timers: Timers,
    waits: WaitTable,
    /// The least of these times, at hand for each completion; `u64::MAX` also if there
    /// is none.
    quiet_until_ns: u64,
    /// How many skips were told of at the instant that is given.
    told: (u64, usize),
    /// Vertices whose instances were cancelled and whose successors do not know
    /// yet.
    ending: Vec<u32>,
    decisions: Vec<Decision>,
    /// The log of each instant's events.
    pub log: EventLog,
}

/// Stands next to a count of instances: a dispatch is owed.
const OWED: u32 = 1 << 31;

/// The state of one DAG.
#[derive(Clone, Debug, Hash)]
struct DagState {
    jobs: JobTable,
    statistics: DagStatistics,
    survived: SurvivedFaults,
    /// When the latest pause has ended; what was due before is skipped.
    resumed_ns: u64,
    /// The jobs that are skipped and not told of.
    untold: Range<u64>,
}

impl Scheduler {
    /// Makes the scheduler of all DAGs on all cores, which are not divided.
    ///
    /// # Panics
    ///
    /// If the options say 0 cores.
    pub fn new(task_set: Arc<TaskSet>, options: SchedulerOptions) -> Self {
        Self::of_cluster(task_set, options, ClusterId(0))
    }

    /// Makes the scheduler of one cluster of the machine that the options describe, with no job
    /// released, and allocates all that it will ever need. Time begins at 0. It counts the
    /// cluster's cores from 0. To it, the DAGs of other clusters are ended.
    ///
    /// # Panics
    ///
    /// If there is no such cluster, or it has no cores.
    #[inline(never)]
    pub fn of_cluster(
        task_set: Arc<TaskSet>,
        mut options: SchedulerOptions,
        cluster: ClusterId,
    ) -> Self {
        // The options are the machine's, the scheduler's only the cluster's part of them.
        options.cores = to_u32(task_set.cores_of(cluster, options.cores).len());
        assert!(
            options.cores > 0,
            "a scheduler for 0 cores; give it at least 1"
        );
        let dags = task_set.dags();
        let longest = dags.iter().map(|dag| dag.subtasks().len()).max();
        let mut slots = 0;
        let states: Box<[DagState]> = dags
            .iter()
            .map(|dag| {
                let first_slot = to_u32(slots);
                // Also those of other clusters' DAGs: so a slot's number is the same in all
                // clusters' keys.
                slots += dag.slots();
                let mut jobs = JobTable::new(dag, options.policy, first_slot);
                // Ended from the beginning on, they never come into the timers or the queue.
                if cluster != dag.cluster() {
                    jobs.end_all();
                }
                DagState {
                    jobs,
                    statistics: DagStatistics::default(),
                    survived: SurvivedFaults::new(dag.on_fault()),
                    resumed_ns: 0,
                    untold: 0..0,
                }
            })
            .collect();
        let waits = WaitTable::new(&task_set);
        let mut timers = Timers::new(&task_set, cluster, waits.len() + 1);
        for (index, (dag, state)) in dags.iter().zip(&states).enumerate() {
            timers.set_dag(index, state.jobs.next_event(dag, 0));
        }
        let mut vertices = VertexTable::new(&task_set, options.preemption);
        Self {
            options,
            log: EventLog::default(),
            dags: states,
            ready: ReadyLines::new(&task_set, &options, cluster, &mut vertices),
            fresh: 0,
            vertices,
            cores: CoreTable::new(options.cores),
            quiet_until_ns: timers.earliest_ns(),
            timers,
            waits,
            told: (0, 0),
            ending: Vec::with_capacity(longest.unwrap_or(0)),
            // A dispatch names a core at most twice: to preempt and to start.
            decisions: Vec::with_capacity(2 * options.cores as usize),
            task_set,
        }
    }

    /// Begins the instant `now_ns`. A time earlier than one before counts as
    /// that one.
    #[inline]
    pub fn at(&mut self, now_ns: u64) -> Moment<'_> {
        self.log.now_ns = self.log.now_ns.max(now_ns);
        Moment::new(self, now_ns)
    }

    /// Has events of these kinds kept as [notices](EventLog::has_notices), and returns how many
    /// there is
    /// room for.
    pub fn hear(&mut self, kinds: impl IntoIterator<Item = EventKind>) -> usize {
        // At one instant a DAG's end may skip and cancel all that it has, and a change of mode
        // each other DAG's waiting job; and a step tells of skips.
        let of_dag = |dag: &Dag| dag.slots() * (dag.subtasks().len() + 4);
        let most = self.task_set.dags().iter().map(of_dag).max();
        let others = 8 * self.dags.len() + SKIPS_A_STEP;
        self.log.hear(kinds, most.unwrap_or(0) + others)
    }

    /// Returns the decisions of the latest dispatch.
    #[inline]
    pub fn decisions(&self) -> &[Decision] {
        &self.decisions
    }

    /// Returns the decisions of the latest dispatch, and the log for what follows from them.
    #[inline]
    pub fn decided(&mut self) -> (&[Decision], &mut EventLog) {
        (&self.decisions, &mut self.log)
    }

    /// Returns when the driver has to begin the next instant, if nothing
    /// completes before: at the next release, or when a deadline has passed. An
    /// ended DAG has neither. `None`: only completions are to come, or nothing.
    #[inline]
    pub fn next_event_ns(&self) -> Option<u64> {
        self.timers.peek().map(|(event_ns, _)| event_ns)
    }

    /// Returns the instance that a core executes.
    ///
    /// # Panics
    ///
    /// If there is no such core.
    #[inline]
    pub fn running(&self, core: CoreId) -> Option<Instance> {
        let vertex = self.runs(core)?;
        Some(self.vertices.get(vertex).present_instance())
    }

    /// Reports whether every DAG [is over](Self::is_over), and every skip is told of.
    #[inline]
    pub fn is_finished(&self) -> bool {
        let dags = self.task_set.dags().iter().zip(&self.dags);
        let are_over = (dags.into_iter()).all(|(dag, state)| state.jobs.are_over(dag));
        are_over && self.timers.time_of(self.skips_timer()).is_none()
    }

    /// Reports whether nothing of a DAG is left to be done: no job is in flight,
    /// and none is to come. A DAG without a limit of jobs is over only once it
    /// [is closed](Self::is_closed) and what it had started has ended; but a sporadic
    /// one is over whenever no signal is pending, and may begin again.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[inline]
    pub fn is_over(&self, dag: DagId) -> bool {
        let state = &self.dags[dag.index()];
        state.jobs.are_over(self.task_set.dag(dag))
    }

    /// Reports whether a DAG releases no further job, whatever comes: it was closed by
    /// [a request](crate::lifecycle::Request::Close), or [is ended](Self::is_ended).
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[inline]
    pub fn is_closed(&self, dag: DagId) -> bool {
        self.dags[dag.index()].jobs.is_closed()
    }

    /// Reports whether a DAG was ended by [`Moment::fail`] or [a
    /// request](crate::lifecycle::Request::End).
    /// Instances of it that had started before may still run.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[inline]
    pub fn is_ended(&self, dag: DagId) -> bool {
        self.phase(dag) == DagPhase::Ended
    }

    /// Returns a DAG's counters.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[inline]
    pub fn statistics(&self, dag: DagId) -> &DagStatistics {
        &self.dags[dag.index()].statistics
    }

    /// Returns the number of jobs of a DAG that are due and wait for an older
    /// job to end.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[inline]
    pub fn waiting(&self, dag: DagId) -> u64 {
        self.dags[dag.index()].jobs.waiting()
    }

    /// Returns the model that is scheduled.
    #[inline]
    pub const fn task_set(&self) -> &Arc<TaskSet> {
        &self.task_set
    }

    /// Returns the options.
    #[inline]
    pub const fn options(&self) -> SchedulerOptions {
        self.options
    }

    /// Returns the latest instant begun, in nanoseconds.
    #[inline]
    pub const fn now_ns(&self) -> u64 {
        self.log.now_ns
    }

    /// Returns the vertex of an instance's subtask. At most one instance of it is
    /// ready or runs at a time.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[inline]
    pub fn vertex(&self, instance: Instance) -> Vertex {
        self.task_set.vertex(instance)
    }

    /// Returns the instance that a vertex does, be it ready, running or preempted. If there
    /// is none, the number of the job means nothing.
    ///
    /// # Panics
    ///
    /// If there is no such vertex.
    #[inline]
    pub fn instance_of(&self, vertex: Vertex) -> Instance {
        self.vertices.get(vertex.0).present_instance()
    }
}

impl Hash for Scheduler {
    fn hash<H: Hasher>(&self, state: &mut H) {
        // The least time is that of the timers, and between instants nothing is ending.
        (self.log.now_ns, &self.dags, &self.vertices, &self.ready).hash(state);
        (
            self.fresh,
            &self.cores,
            &self.timers,
            &self.waits,
            self.told,
        )
            .hash(state);
    }
}

/// Counts over the jobs of one DAG since the scheduler was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct DagStatistics {
    /// Jobs released.
    pub released: u64,
    /// Jobs of which all subtasks have finished.
    pub completed: u64,
    /// Jobs whose deadline has passed before they were complete, whether they
    /// were released or still waited for their release.
    pub misses: u64,
    /// Misses since a job last met its deadline.
    pub consecutive_misses: u64,
    /// The most misses without a job between them that met its deadline.
    pub most_consecutive_misses: u64,
    /// Releases that did not happen.
    pub skips: u64,
    /// Jobs aborted.
    pub aborts: u64,
    /// Releases that had to wait for an older job to end.
    pub queued: u64,
    /// Signals to a sporadic DAG.
    pub signals: u64,
    /// Signals that came while an earlier one was still kept, or no job was left.
    pub dropped_signals: u64,
    /// Instances that a fault has ended.
    pub faults: u64,
    /// Jobs that a fault has cut while the DAG went on.
    pub failed: u64,
    /// Faults after which the DAG went on.
    pub restarts: u64,
    /// Jobs that were in flight when the DAG was ended, without those cut before.
    pub cut_short: u64,
    /// Releases that still waited for an older job when the DAG was ended.
    pub dropped: u64,
}

impl DagStatistics {
    #[inline]
    fn count_miss(&mut self) {
        self.misses += 1;
        self.consecutive_misses += 1;
        self.most_consecutive_misses = self.most_consecutive_misses.max(self.consecutive_misses);
    }

    #[inline]
    fn count_met(&mut self) {
        self.consecutive_misses = 0;
    }
}
