//! The driver in virtual time: a [`Scheduler`] run without a machine, or one for each cluster.
//!
//! Time jumps from event to event. The work of the cores comes from a [`Workload`], asked for the
//! execution time of each instance at its start, and again after each wait. The workload may run
//! the function of the instance's [body](SubtaskBody) to find out.
//!
//! An instance with an execution time of 0 finishes at the instant of its start, after the dispatch
//! of the start. Another dispatch at the same instant follows, and so on until nothing happens any
//! more.
//!
//! Clusters share a clock: everything ending at one instant ends in all clusters before anything
//! starts in any of them.
//!
//! A workload may let an instance fail at the end of its execution time, or instead of beginning a
//! wait, which ends the DAG or costs the job. At one instant, completions come before failures, and
//! failures in the order of their instances.
//!
//! Once a run is made, it allocates nothing here, except for the journal of
//! [`VirtualTime::recording`].
//!
//! ```
//! use std::sync::Arc;
//! use sched_dag::virtual_time::{RunOutcome, ExecutionTimes, VirtualTime};
//! use sched_dag::{
//!     CommitOptions, DagId, DagSpec, Policy, Preemption, SchedulerOptions, SubtaskSpec, verify,
//! };
//!
//! let dag = DagSpec {
//!     period_ns: Some(100),
//!     relative_deadline_ns: Some(50),
//!     jobs: Some(3),
//!     subtasks: vec![SubtaskSpec::default(), SubtaskSpec::default()],
//!     edges: vec![(0, 1)],
//!     ..DagSpec::default()
//! };
//! let commit = CommitOptions::new(Policy::Edf, 1);
//! let tasks = Arc::new(verify(&[dag], &commit).expect("the DAG is right").task_set);
//! let options = SchedulerOptions {
//!     policy: Policy::Edf,
//!     preemption: Preemption::Enabled,
//!     cores: 1,
//! };
//! let mut run = VirtualTime::new(&tasks, options);
//! let outcome = run.run(&mut ExecutionTimes(|_instance| 20));
//! assert_eq!((outcome, run.now_ns()), (RunOutcome::Finished, 240));
//! assert_eq!(run.scheduler_of(DagId(0)).statistics(DagId(0)).misses, 0);
//! ```

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;

use crate::engine::{Engine, FaultCost, NextAction, PlatformPort, Run, SubtaskBody};
use crate::ids::{ClusterId, CoreId, DagId, Instance, SubtaskId};
use crate::journal::{Event, EventKind, EventSubject};
use crate::kept::Journal;
use crate::lifecycle::{self, Lifecycle, Mailboxes, PendingRequests, Request, WaitId, WaitLimit};
use crate::placement::NextWork;
use crate::policies::SchedulerOptions;
use crate::scheduler::{DriverNotice, Moment, Scheduler};
use crate::task_set::TaskSet;

/// A scheduler in virtual time with its bodies, or the schedulers of all clusters.
pub struct VirtualTime<B: SubtaskBody = Instance> {
    clusters: Box<[ClusterRun<B>]>,
    now_ns: u64,
    /// Instances failing at the present instant.
    failing: Vec<(Instance, CoreId, B)>,
    letters: Arc<Mailboxes>,
}

/// The reason why a run in virtual time has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub enum RunOutcome {
    /// Every job of every DAG has ended; an ended DAG has no further jobs. Or nothing happens any
    /// more, because a sporadic DAG gets no further signal.
    Finished,
    /// The next event lies after the requested end of the run.
    TimeReached,
    /// The instance would finish after the last representable time. The run cannot be continued.
    TimeOverflow(Instance),
    /// The workload has [stopped](Workload::stops) the run.
    Stopped,
}

impl VirtualTime {
    /// Makes a driver for a task set on the machine described by the options, and allocates all
    /// memory for the run.
    pub fn new(task_set: &Arc<TaskSet>, options: SchedulerOptions) -> Self {
        Self::of_bodies(task_set, options, instances(task_set), &[])
    }
}

fn instances(task_set: &TaskSet) -> impl Iterator<Item = Instance> {
    let dags = (0..).map(DagId).zip(task_set.dags());
    dags.flat_map(|(dag, model)| {
        let subtasks = (0..).map(SubtaskId).take(model.subtasks().len());
        let job = 0;
        subtasks.map(move |subtask| Instance { dag, job, subtask })
    })
}

impl<B: SubtaskBody> VirtualTime<B> {
    /// Makes a driver with a body for each subtask. For each DAG, `after_fault` names the DAG to be
    /// signalled when a fault ends it.
    pub fn of_bodies(
        task_set: &Arc<TaskSet>,
        options: SchedulerOptions,
        bodies: impl IntoIterator<Item = B>,
        after_fault: &[Option<DagId>],
    ) -> Self {
        type Any<'a> = VirtualInstant<'a, ExecutionTimes<fn(Instance) -> u64>>;
        let none = task_set.clusters().map(|_| None).collect();
        let no_journal = |_| Journal::default();
        let engines =
            Engine::of_clusters::<Any<'_>>(task_set, options, none, after_fault, no_journal);
        let clusters = engines.map(|engine| ClusterRun {
            running: (0..engine.scheduler.options().cores)
                .map(|_| None)
                .collect(),
            engine,
        });
        let clusters: Box<[ClusterRun<B>]> = clusters.collect();
        let cores = |cluster: &ClusterRun<B>| cluster.engine.scheduler.options().cores as usize;
        let mut this = Self {
            failing: Vec::with_capacity(clusters.iter().map(cores).sum()),
            now_ns: 0,
            clusters,
            letters: Arc::new(Mailboxes::new(task_set, ClusterId(0))),
        };
        for body in bodies {
            let instance = body.subject().instance();
            let engine = &mut this.clusters[this.cluster_index(instance.dag)].engine;
            engine.put(engine.task_set.vertex(instance), body);
        }
        this
    }

    /// Sets the lifecycle, which serves requests other than signals.
    ///
    /// # Errors
    ///
    /// The reason why the lifecycle cannot be divided among the clusters.
    pub fn with_lifecycle(
        mut self,
        lifecycle: Option<Box<dyn Lifecycle>>,
    ) -> Result<Self, &'static str> {
        let task_set = &self.clusters[0].engine.task_set;
        let dags = task_set.dags().len();
        let (letters, parts) = lifecycle::divide(task_set, lifecycle.as_deref())?;
        self.letters = Arc::new(letters);
        for (cluster, part) in self.clusters.iter_mut().zip(parts) {
            cluster.engine.requests = PendingRequests::new(dags, part);
        }
        Ok(self)
    }

    /// Records all events in a journal.
    #[must_use]
    pub fn recording(mut self) -> Self {
        for cluster in &mut self.clusters {
            cluster.engine.scheduler.log.journal = Journal::growing();
        }
        self
    }

    /// Returns the run so far, of all clusters, as if it were over.
    #[must_use]
    pub fn run_so_far(&self) -> Run {
        let journal = |cluster: &ClusterRun<B>| cluster.engine.scheduler.log.journal.clone();
        let cores = |cluster: &ClusterRun<B>| cluster.engine.scheduler.options().cores;
        let cores = self.clusters.iter().map(cores).sum();
        let first = &self.clusters[0];
        let mut run = Run::so_far(&first.engine, journal(first), cores);
        for cluster in &self.clusters[1..] {
            run.add(&cluster.engine, journal(cluster));
        }
        run
    }

    /// Returns the events so far, of all clusters; none unless the run is
    /// [recording](Self::recording).
    pub fn events(&self) -> Vec<Event> {
        self.run_so_far().journal().events().collect()
    }

    /// Runs until every job has ended.
    ///
    /// For a periodic DAG without a limit of jobs that is the end of time; see
    /// [`run_until`](Self::run_until).
    pub fn run(&mut self, workload: &mut impl Workload<B>) -> RunOutcome {
        self.run_until(u64::MAX, workload)
    }

    /// Runs all events up to and including `until_ns`. May be called again with a later time.
    pub fn run_until(&mut self, until_ns: u64, workload: &mut impl Workload<B>) -> RunOutcome {
        let begun_ns = Ok(0);
        let now = &mut VirtualInstant {
            now_ns: self.now_ns,
            workload,
            begun_ns,
            letters: &Arc::clone(&self.letters),
            has_letters: false,
        };
        while !now.workload.stops() {
            let of_scheduler = |cluster: &ClusterRun<B>| cluster.engine.scheduler.next_event_ns();
            let due = self.clusters.iter().filter_map(of_scheduler);
            // Another event may already have moved the time past the due time.
            let interrupts = due.map(|due_ns| {
                (due_ns.saturating_add(now.workload.late_ns(due_ns))).max(self.now_ns)
            });
            let scheduler_ns = interrupts.min();
            let request_ns = now.workload.next_request_ns();
            // A request for an earlier time comes now: time does not go back.
            let request_ns = request_ns.map(|request_ns| request_ns.max(self.now_ns));
            // The earliest event decides; all events at the same time form one instant.
            let events = [self.next_finish_ns(), scheduler_ns, request_ns];
            let Some(event_ns) = events.into_iter().flatten().min() else {
                return RunOutcome::Finished;
            };
            // No event is taken yet, so a later call goes on here.
            if event_ns > until_ns {
                return RunOutcome::TimeReached;
            }
            now.now_ns = event_ns;
            if let Err(end) = self.step(now) {
                return end;
            }
        }
        RunOutcome::Stopped
    }

    /// Returns the time of the last event, in nanoseconds.
    pub const fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Returns the scheduler of a DAG, for its statistics.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    pub fn scheduler_of(&self, dag: DagId) -> &Scheduler {
        &self.clusters[self.cluster_index(dag)].engine.scheduler
    }

    /// Reports whether every DAG is over.
    pub fn is_finished(&self) -> bool {
        let mut clusters = self.clusters.iter();
        clusters.all(|cluster| cluster.engine.scheduler.is_finished())
    }

    fn next_finish_ns(&self) -> Option<u64> {
        let of_cores = |cluster: &ClusterRun<B>| cluster.next_finish_ns();
        self.clusters.iter().filter_map(of_cores).min()
    }

    /// Runs one instant. The error is the outcome when the run cannot go on.
    fn step(&mut self, now: &mut VirtualInstant<'_, impl Workload<B>>) -> Result<(), RunOutcome> {
        self.now_ns = now.now_ns;
        // A waiting mode comes after all completions and faults of the instant (M3).
        let mut waiting = None;
        for (place, cluster) in self.clusters.iter_mut().enumerate() {
            let is_mode = |request| request == Request::GoOn && waiting.replace(place).is_none();
            cluster.engine.requests.give_away(is_mode);
        }
        // The short way was the whole instant.
        if self.finish(waiting.is_none(), now)? {
            return Ok(());
        }
        let mut failing = core::mem::take(&mut self.failing);
        // In an order independent of cores: D6 counts faults in the order in which they are
        // reported.
        failing.sort_unstable_by_key(|(instance, ..)| *instance);
        for (instance, core, body) in failing.drain(..) {
            let place = self.cluster_index(instance.dag);
            self.clusters[place].fail(core, body, now);
        }
        // The list goes back to keep its memory.
        self.failing = failing;
        if let Some(place) = waiting {
            self.clusters[place].engine.requests.keep(Request::GoOn);
        }
        let asked =
            (self.clusters.iter_mut()).filter(|cluster| !cluster.engine.requests.are_none());
        asked.for_each(|cluster| cluster.tell(now, |_| ()));
        while let Some(request) = now.workload.take_request(now.now_ns) {
            self.serve(request, now);
        }
        let mut clusters = self.clusters.iter_mut();
        clusters.try_for_each(|cluster| cluster.decide(now))
    }

    /// Completes the instances finishing now, and notes the instances failing instead. If only one
    /// instance finishes and nothing else happens, its completion `may_be_all` of the instant; the
    /// result reports whether it was.
    fn finish(
        &mut self,
        mut may_be_all: bool,
        now: &mut VirtualInstant<'_, impl Workload<B>>,
    ) -> Result<bool, RunOutcome> {
        for place in 0..self.clusters.len() {
            while let Some((core, body)) = self.clusters[place].take_finished(now.now_ns) {
                let mut others_ns =
                    [self.next_finish_ns(), now.workload.next_request_ns()].into_iter();
                let is_last = others_ns.all(|ns| ns.is_none_or(|ns| ns > now.now_ns));
                // The short way is right only if nothing else happens at this instant.
                let is_alone = core::mem::take(&mut may_be_all) && is_last;
                let (cluster, instance) = (&mut self.clusters[place], body.subject().instance());
                if now.workload.fails(instance) {
                    self.failing.push((instance, core, body));
                } else if cluster.complete(core, body, is_alone, now)? {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    /// Serves a request at this instant, in the clusters concerned.
    fn serve(&mut self, request: Request, now: &mut VirtualInstant<'_, impl Workload<B>>) {
        self.letters.send(None, request, |cluster| {
            now.has_letters = true;
            self.clusters[cluster.index()].tell(now, |_| ());
        });
    }

    /// Returns the place of the cluster running a DAG.
    fn cluster_index(&self, dag: DagId) -> usize {
        match &*self.clusters {
            // Undivided cores are one cluster, whatever the DAGs state.
            [_] => 0,
            several => several[0].engine.task_set.dag(dag).cluster().index(),
        }
    }
}

impl<B: SubtaskBody> fmt::Debug for VirtualTime<B> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut shown = f.debug_struct("VirtualTime");
        shown.field("now_ns", &self.now_ns).finish_non_exhaustive()
    }
}

/// The behaviour of instances, and their execution times.
pub trait Workload<B = Instance> {
    /// Returns the execution time of an instance in nanoseconds, up to the end or the next wait; 0
    /// is allowed. Called once for each instance at its start, and again after each wait. `None`:
    /// the run is [stopped](RunOutcome::Stopped) at once.
    fn execute(&mut self, body: &mut B, now_ns: u64) -> Option<u64>;

    /// Reports whether an instance fails, instead of finishing, at the end of the execution time.
    /// The failure ends the DAG, or cuts the job. Called once for each instance, at its end, and
    /// before each begin of a wait.
    fn fails(&mut self, _instance: Instance) -> bool {
        false
    }

    /// Reports whether the function of a failing instance could be replaced, if its body agrees.
    /// Called once for each failure, right before the scheduler is told.
    fn is_replaceable(&mut self, _instance: Instance) -> bool {
        true
    }

    /// Called when an instance has ended and the outputs are published, or when a fault has ended
    /// the instance at the given cost.
    fn ended(&mut self, _instance: Instance, _now_ns: u64, _fault: Option<FaultCost>) {}

    /// Called when an instance has begun a wait. From now on a [`Request::Answer`] may answer the
    /// wait.
    fn waits(&mut self, _wait: WaitId, _now_ns: u64) {}

    /// Called when a job is released, skipped or completed, an instance is cancelled, or a DAG is
    /// ended.
    fn hear(&mut self, _notice: &DriverNotice) {}

    /// Takes a request made now by a completion or a fault.
    fn request(&mut self, _request: Request, _now_ns: u64) {}

    /// Returns the time of the next request, in nanoseconds. Called again at every instant.
    fn next_request_ns(&self) -> Option<u64> {
        None
    }

    /// Returns the next request due by now, and forgets it.
    fn take_request(&mut self, _now_ns: u64) -> Option<Request> {
        None
    }

    /// Returns the delay of the timer interrupt due at the given time, in nanoseconds. An earlier
    /// step of the scheduler does the due work before the interrupt. Called several times for one
    /// interrupt.
    fn late_ns(&self, _due_ns: u64) -> u64 {
        0
    }

    /// Reports whether the run is to stop, even if jobs are left. Called before each instant.
    fn stops(&self) -> bool {
        false
    }
}

/// A workload with nothing but execution times.
#[derive(Debug)]
pub struct ExecutionTimes<F>(
    /// Returns the execution time of an instance in nanoseconds.
    pub F,
);

impl<B: SubtaskBody, F: FnMut(Instance) -> u64> Workload<B> for ExecutionTimes<F> {
    fn execute(&mut self, body: &mut B, _now_ns: u64) -> Option<u64> {
        Some((self.0)(body.subject().instance()))
    }
}

/// Serves as a body without a function, always replaceable.
impl SubtaskBody for Instance {
    type Alternate = ();

    fn set_job(&mut self, job: u64) {
        self.job = job;
    }

    fn subject(&self) -> EventSubject {
        EventSubject::of(*self)
    }

    fn discard(&mut self, _: u64) {}

    fn has_effects(&self) -> bool {
        false
    }

    fn complete(&mut self, _: u64, _: &mut dyn FnMut(Request)) -> Option<WaitLimit> {
        None
    }

    fn alternate(&self) -> Option<()> {
        Some(())
    }

    fn replace(&mut self) {}
}

/// A cluster: a scheduler with its bodies, running by itself.
struct ClusterRun<B: SubtaskBody> {
    /// A parked body comes with the time left for its instance.
    engine: Engine<B, (u64, B)>,
    /// By core, the body of its instance, and the finish time if nothing intervenes.
    running: Box<[Option<(u64, B)>]>,
}

/// An instant in virtual time.
struct VirtualInstant<'a, W> {
    now_ns: u64,
    workload: &'a mut W,
    /// The execution time of the instance begun last.
    begun_ns: Result<u64, RunOutcome>,
    letters: &'a Mailboxes,
    /// Whether there are letters for the cluster told next.
    has_letters: bool,
}

impl<B: SubtaskBody, W: Workload<B>> PlatformPort<B> for VirtualInstant<'_, W> {
    const HEARS: &'static [EventKind] = &[
        EventKind::Released,
        EventKind::Skipped,
        EventKind::DagEnded,
        EventKind::Completed,
    ];
    const SUSPENDS_LATER: bool = false;
    const ANSWERS_AT_ONCE: bool = true;

    fn now_ns(&self) -> u64 {
        self.now_ns
    }

    fn start(&mut self, _: CoreId, body: &mut B, _: u64) -> u64 {
        let execution_ns = self.workload.execute(body, self.now_ns);
        // No error can be returned from here; the loop checks `begun_ns` when the step is over.
        self.begun_ns = execution_ns.ok_or(RunOutcome::Stopped);
        self.now_ns
    }

    /// All requests of an instant are served after all its completions.
    fn forward(&mut self, request: Request) -> bool {
        let is_own = matches!(request, Request::Step | Request::Begin | Request::GoOn);
        if !is_own {
            self.workload.request(request, self.now_ns);
        }
        !is_own
    }

    fn has_letters(&self) -> bool {
        self.has_letters
    }

    fn take_letters(&mut self) -> Option<&Mailboxes> {
        core::mem::take(&mut self.has_letters).then_some(self.letters)
    }

    fn hear(&mut self, notice: &DriverNotice) {
        self.workload.hear(notice);
    }
}

impl<B: SubtaskBody> ClusterRun<B> {
    fn next_finish_ns(&self) -> Option<u64> {
        let running = self.running.iter().flatten();
        running.map(|(finish_ns, _)| *finish_ns).min()
    }

    /// Takes an instance finishing by now from the first core with such an instance.
    fn take_finished(&mut self, now_ns: u64) -> Option<(CoreId, B)> {
        let mut cores = (0..).map(CoreId).zip(&mut self.running);
        cores.find_map(|(core, running)| {
            let (_, body) = running.take_if(|(finish_ns, _)| *finish_ns <= now_ns)?;
            Some((core, body))
        })
    }

    /// Makes a change at an instant, which stays open.
    fn tell(
        &mut self,
        now: &mut VirtualInstant<'_, impl Workload<B>>,
        change: impl FnOnce(&mut Moment<'_>),
    ) {
        let here = self.engine.scheduler.log.here;
        self.engine.tell((now.now_ns, here), now, change);
    }

    /// Completes the finished instance of a core, and reports whether its completion is the whole
    /// instant.
    fn complete(
        &mut self,
        core: CoreId,
        body: B,
        is_alone: bool,
        now: &mut VirtualInstant<'_, impl Workload<B>>,
    ) -> Result<bool, RunOutcome> {
        let (engine, now_ns) = (&mut self.engine, now.now_ns);
        let instance = body.subject().instance();
        let vertex = engine.task_set.vertex(instance);
        let done = engine.complete((core, vertex), body, now_ns, is_alone, now);
        let waits = matches!(done, NextAction::Step(Some(turn)) if turn.limit_ns.is_some());
        if !waits {
            now.workload.ended(instance, now_ns, None);
        }
        match done {
            NextAction::Run(body) => self.run(core, body, now_ns, now.begun_ns)?,
            NextAction::Look { .. } => self.go_on(core, now)?,
            NextAction::Step(ended) => {
                if let Some(turn) = ended {
                    engine.tell((now_ns, core), now, |moment| moment.end_turn(turn));
                }
                if waits {
                    now.workload
                        .waits(engine.scheduler.latest_wait(vertex).0, now_ns);
                }
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Ends the failed instance of a core.
    fn fail(&mut self, core: CoreId, body: B, now: &mut VirtualInstant<'_, impl Workload<B>>) {
        let instance = body.subject().instance();
        if let Some(vertex) = self.engine.placement.lose(core.index()) {
            let body = Some(body).filter(|_| now.workload.is_replaceable(instance));
            let cost = (self.engine).tell_fault((now.now_ns, core), vertex, body, now);
            now.workload.ended(instance, now.now_ns, Some(cost));
        }
    }

    /// Ends the instant, and makes its cores carry out the decisions.
    fn decide(&mut self, now: &mut VirtualInstant<'_, impl Workload<B>>) -> Result<(), RunOutcome> {
        let now_ns = now.now_ns;
        self.engine.decide(now_ns, now);
        for place in 0..self.engine.decisions().len() {
            let decision = self.engine.decisions()[place];
            let core = decision.core;
            if decision.what == EventKind::Suspend {
                if let Some((finish_ns, body)) = self.running[core.index()].take() {
                    let parked = (finish_ns - now_ns, body);
                    self.engine.suspend(core, now_ns, parked);
                }
            } else {
                self.go_on(core, now)?;
            }
        }
        Ok(())
    }

    /// Makes a core without an instance begin or continue its next instance.
    fn go_on(
        &mut self,
        core: CoreId,
        now: &mut VirtualInstant<'_, impl Workload<B>>,
    ) -> Result<(), RunOutcome> {
        let (engine, now_ns) = (&mut self.engine, now.now_ns);
        match engine.next((now_ns, core), now) {
            NextWork::Nothing => Ok(()),
            NextWork::Start(_, body) | NextWork::Proceed(_, body) => {
                self.run(core, body, now_ns, now.begun_ns)
            }
            NextWork::Continue((left_ns, body)) => {
                let vertex = engine.task_set.vertex(body.subject().instance());
                engine.note(EventKind::Resume, core, vertex, now_ns);
                self.run(core, body, now_ns, Ok(left_ns))
            }
        }
    }

    fn run(
        &mut self,
        core: CoreId,
        body: B,
        now_ns: u64,
        left_ns: Result<u64, RunOutcome>,
    ) -> Result<(), RunOutcome> {
        let finish_ns = now_ns.checked_add(left_ns?);
        let finish_ns = finish_ns.ok_or(RunOutcome::TimeOverflow(body.subject().instance()))?;
        self.running[core.index()] = Some((finish_ns, body));
        Ok(())
    }
}
