//! The scheduler as a pure state machine.
//!
//! The scheduler has no clock, no thread and no I/O. A *driver* reports events with their times;
//! the scheduler answers with *decisions*. All its memory is allocated at construction, except for
//! [notices](Scheduler::hear) and a growing journal.
//!
//! # One instant
//!
//! R5 orders the events of one instant: completions, then releases, then one dispatch that sees
//! both. The types force this order:
//!
//! 1. [`Scheduler::at`] begins the instant and returns a [`Moment`], which takes completions,
//!    waits, faults, and requests such as signals to sporadic DAGs;
//! 2. [`Moment::dispatch`] ends the instant: it releases due jobs, then returns the [`Decision`]s.
//!
//! A driver calls them when a subtask has returned, waits or has failed, when a request has come,
//! and at the latest at [`Scheduler::next_event_ns`].
//!
//! # Guarantees
//!
//! - The rules R1 to R5 (see the [crate]), with the key stated in R5.
//! - Each released job ends exactly once, in the order of its DAG's jobs, if its started instances
//!   end; and each due job is released, skipped, or dropped with its DAG's end, exactly once.
//! - Bounded steps: a release costs the sources of its DAG, a completion the successors of its
//!   subtask, a decision the logarithm of the number of subtasks, and a look at all cores if it may
//!   preempt. Tables add at most two laps of each list to a step. Besides, a cut job costs its
//!   instances, once; at one instant these are at most the DAG's subtasks and edges times the jobs
//!   that may be in flight. A skipped backlog costs [`SKIPS_A_STEP`] events a step, however long
//!   the backlog is. After a pause of the driver, each release and each deadline passed meanwhile
//!   costs its step.
//!
//! # Limits
//!
//! The scheduler does not know execution times: a subtask that never returns keeps its core (or,
//! preempted, its place in line) until the driver reports a fault. The scheduler does not measure,
//! but trusts the driver's times; a time before the latest instant counts as that instant in all
//! decisions.

mod bits;
mod dispatch;
mod groups;
mod heap;
mod instances;
mod job_heap;
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
/// A copy goes on by itself, as if it had received all reports made to the original. Copies of one
/// scheduler with equal [hashes](Hash) are taken for the same state: the hash leaves out the task
/// set and the options.
#[derive(Clone, Debug)]
pub struct Scheduler {
    task_set: Arc<TaskSet>,
    options: SchedulerOptions,
    dags: Box<[DagState]>,
    vertices: VertexTable,
    /// The instances in line for a core: ready, or preempted.
    ready: ReadyLines,
    /// The number of instances that have become ready since the last dispatch, and [`OWED`] if
    /// since then a core has become idle that the next instance in line may need.
    fresh: u32,
    cores: CoreTable,
    /// For each DAG, the time of its next event without a completion; behind the DAGs, the latest
    /// end of each wait, the time of the next report of skips, and the lanes of release classes.
    timers: Timers,
    waits: WaitTable,
    /// The earliest of these times, at hand for each completion; `u64::MAX` also if there is none.
    quiet_until_ns: u64,
    /// An instant, and the number of skips reported at that instant.
    told: (u64, usize),
    /// Vertices with cancelled instances whose successors have not been told yet.
    ending: Vec<u32>,
    decisions: Vec<Decision>,
    /// The log of each instant's events.
    pub log: EventLog,
}

/// A flag in the count of ready instances: a dispatch is owed.
const OWED: u32 = 1 << 31;

/// The state of one DAG.
#[derive(Clone, Debug, Hash)]
struct DagState {
    jobs: JobTable,
    statistics: DagStatistics,
    survived: SurvivedFaults,
    /// The end of the latest pause; jobs due before are skipped.
    resumed_ns: u64,
    /// The skipped jobs still to be reported.
    untold: Range<u64>,
}

impl Scheduler {
    /// Makes the scheduler of all DAGs on all cores, without clusters.
    ///
    /// # Panics
    ///
    /// If the options say 0 cores.
    pub fn new(task_set: Arc<TaskSet>, options: SchedulerOptions) -> Self {
        Self::of_cluster(task_set, options, ClusterId(0))
    }

    /// Makes the scheduler of one cluster of the machine described by the options, with no job
    /// released, and allocates all its memory. Time begins at 0. The scheduler counts the cluster's
    /// cores from 0, and treats the DAGs of other clusters as ended.
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
        // The options describe the machine; the scheduler has only the cluster's part.
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
                // Also the slots of other clusters' DAGs, so that a slot has the same number in all
                // clusters' keys.
                slots += dag.slots();
                let mut jobs = JobTable::new(dag, options.policy, first_slot);
                // Ended from the beginning on, they never enter the timers or the queue.
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

    /// Begins the instant `now_ns`. A time before the latest instant counts as that instant, but
    /// the end of a turn is recorded at the given time, and the limit of a wait counts from there.
    #[inline]
    pub fn at(&mut self, now_ns: u64) -> Moment<'_> {
        self.log.now_ns = self.log.now_ns.max(now_ns);
        Moment::new(self, now_ns)
    }

    /// Keeps events of these kinds as [notices](EventLog::has_notices) from now on, and returns the
    /// number of notices there is room for. Events on a core, and [`Ready`](EventKind::Ready),
    /// never become notices.
    pub fn hear(&mut self, kinds: impl IntoIterator<Item = EventKind>) -> usize {
        // At one instant a DAG's end may cancel all instances of the DAG, and a change of mode may
        // skip a job of each other DAG; a step also reports earlier skips.
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

    /// Returns the decisions of the latest dispatch, and the log for the events that follow from
    /// them.
    #[inline]
    pub fn decided(&mut self) -> (&[Decision], &mut EventLog) {
        (&self.decisions, &mut self.log)
    }

    /// Returns the time of the next instant, if the driver has nothing to report before, such as a
    /// completion or a request: the next release, the first nanosecond after a deadline, the limit
    /// of a wait, or the next report of skips. An ended DAG has no release and no deadline to come.
    /// `None`: only reports of the driver are to come, or nothing.
    #[inline]
    pub fn next_event_ns(&self) -> Option<u64> {
        self.timers.peek().map(|(event_ns, _)| event_ns)
    }

    /// Returns the instance that a core executes by the latest decisions; `None` if the core is
    /// idle. The cores of a machine follow the decisions a little later.
    ///
    /// # Panics
    ///
    /// If there is no such core.
    #[inline]
    pub fn running(&self, core: CoreId) -> Option<Instance> {
        let vertex = self.runs(core)?;
        Some(self.vertices.get(vertex).present_instance())
    }

    /// Reports whether every DAG [is over](Self::is_over), and every skip is reported.
    #[inline]
    pub fn is_finished(&self) -> bool {
        let dags = self.task_set.dags().iter().zip(&self.dags);
        let are_over = (dags.into_iter()).all(|(dag, state)| state.jobs.are_over(dag));
        are_over && self.timers.time_of(self.skips_timer()).is_none()
    }

    /// Reports whether nothing of a DAG is left to be done: no job is in flight, and none is to
    /// come. A DAG without a limit of jobs is over only once it [is closed](Self::is_closed) and
    /// its started instances have ended. But a sporadic DAG without a limit is over whenever
    /// nothing of it is in flight and no signal is kept, and may begin again.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[inline]
    pub fn is_over(&self, dag: DagId) -> bool {
        let state = &self.dags[dag.index()];
        state.jobs.are_over(self.task_set.dag(dag))
    }

    /// Reports whether a DAG releases no further job, whatever comes: the DAG was closed by [a
    /// request](crate::lifecycle::Request::Close), or [is ended](Self::is_ended).
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[inline]
    pub fn is_closed(&self, dag: DagId) -> bool {
        self.dags[dag.index()].jobs.is_closed()
    }

    /// Reports whether a DAG was ended, by a fault ([`Moment::fail`], [`Moment::fail_replaceable`])
    /// or [a request](crate::lifecycle::Request::End), or belongs to another cluster. Instances
    /// started before may still run.
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

    /// Returns the number of a DAG's due jobs waiting for an older job to end.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[inline]
    pub fn waiting(&self, dag: DagId) -> u64 {
        self.dags[dag.index()].jobs.waiting()
    }

    /// Returns the scheduled task set.
    #[inline]
    pub const fn task_set(&self) -> &Arc<TaskSet> {
        &self.task_set
    }

    /// Returns the options; `cores` is the number of the cluster's cores.
    #[inline]
    pub const fn options(&self) -> SchedulerOptions {
        self.options
    }

    /// Returns the latest instant begun, in nanoseconds.
    #[inline]
    pub const fn now_ns(&self) -> u64 {
        self.log.now_ns
    }

    /// Returns the vertex of an instance's subtask. At most one instance of a subtask is ready,
    /// runs, waits or is preempted at a time.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[inline]
    pub fn vertex(&self, instance: Instance) -> Vertex {
        self.task_set.vertex(instance)
    }

    /// Returns a vertex's present instance, be it ready, running, waiting or preempted. If there is
    /// none, the number of the job means nothing.
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
        // The earliest time follows from the timers, and between instants nothing is ending.
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
    /// Jobs with all subtasks finished, without those cut before.
    pub completed: u64,
    /// Jobs in which some sink had not finished by its deadline, whether they were released or
    /// still waited for their release. A job cut or skipped before that deadline does not count.
    pub misses: u64,
    /// Misses since a job last met its deadline.
    pub consecutive_misses: u64,
    /// The most misses in a row, without a job in between meeting its deadline.
    pub most_consecutive_misses: u64,
    /// Due jobs skipped, by the overrun policy, a pause or a closing.
    pub skips: u64,
    /// Jobs aborted.
    pub aborts: u64,
    /// Releases that had to wait for an older job to end.
    pub queued: u64,
    /// Signals to a sporadic DAG.
    pub signals: u64,
    /// Signals that came while an earlier one was still kept, or when the DAG was closed, ended or
    /// at its limit of jobs.
    pub dropped_signals: u64,
    /// Instances ended by a fault.
    pub faults: u64,
    /// Jobs cut by a fault while the DAG went on.
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
