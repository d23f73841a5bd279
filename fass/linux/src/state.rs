//! What is under the scheduler's lock, and one step of it.
//!
//! The scheduler decides at one instant what each core runs; [`Placement`] keeps what
//! each core has, and what it should have. A core that has too much loses it here, by
//! the thread that makes the step; a core that has nothing and should have something is *called*:
//! its worker comes and looks.

use std::sync::Arc;

use fass::Body;
use sched_dag::journal::What;
use sched_dag::lifecycle::{Request, Requests};
use sched_dag::placement::{Next, Placement};
use sched_dag::{
    ClusterId, CoreId, DagId, Decision, Instance, Journal, Moment, Observer, Recorder, Scheduler,
    TaskSet, Vertex,
};

use crate::level::{Levels, Role};
use crate::office::Office;
use crate::sys;
use crate::worker::Worker;

/// What runs the instances of one subtask. Boxed where it moves.
pub(crate) struct Runner {
    pub(crate) body: Body,
    pub(crate) vertex: Vertex,
    /// The job whose instance it runs, or ran last.
    pub(crate) job: u64,
}

/// An instance that has finished, and is not reported yet.
pub(crate) struct Left {
    pub(crate) worker: Number,
    pub(crate) runner: Box<Runner>,
    /// When its function returned, on the clock.
    pub(crate) finish_ns: u64,
}

/// The number of a worker.
pub(crate) type Number = usize;

/// A fault that ended a DAG.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The instance that failed.
    pub instance: Instance,
    /// Why: a panic's message, or that the budget was exceeded.
    pub cause: String,
    /// Whether it is the latter.
    pub is_overrun: bool,
}

/// The scheduler of a cluster, its bodies, and which worker runs what.
pub(crate) struct State {
    pub(crate) cluster: ClusterId,
    pub(crate) office: Arc<Office>,
    pub(crate) scheduler: Scheduler,
    pub(crate) recorder: Recorder<Journal>,
    pub(crate) placement: Placement<Box<Runner>, Number>,
    pub(crate) task_set: Arc<TaskSet>,
    /// By core, the worker that runs what the core should.
    pub(crate) active: Box<[Number]>,
    /// By worker, the core of which it is the active one.
    pub(crate) seats: Box<[Option<CoreId>]>,
    /// By worker, the core to whose processor it is pinned.
    pinned: Box<[Option<CoreId>]>,
    /// By worker, when its instance last went on after it had lost its core, on the clock.
    pub(crate) resumed_ns: Box<[u64]>,
    /// What a worker that reports an end has just taken the processor from.
    pub(crate) interrupted: Option<(CoreId, Vertex)>,
    /// What has finished after it had lost its core, and is not reported yet.
    pub(crate) left: Vec<Left>,
    /// Workers without a core and without an instance.
    pub(crate) spare: Vec<Number>,
    /// Workers whose instance has exceeded its budget. They are never used again.
    pub(crate) abandoned: Vec<Number>,
    pub(crate) requests: Requests,
    /// How often letters were taken that the release thread has not settled yet.
    pub(crate) opened: u64,
    /// By DAG, the one that gets a signal when a fault ends it.
    after_fault: Vec<Option<DagId>>,
    pub(crate) faults: Vec<Fault>,
    /// The cores that have to look for work.
    called: Vec<CoreId>,
    decisions: Vec<Decision>,
    pub(crate) processors: Box<[u32]>,
    pub(crate) levels: Option<Levels>,
    /// Time 0 of the run on the clock; `u64::MAX` until the run has begun.
    pub(crate) epoch_ns: u64,
    pub(crate) preemptions: u64,
}

/// Has bodies drop what arrived for instances that will not run.
struct Discard<'a>(&'a mut Placement<Box<Runner>, Number>, &'a TaskSet);

impl Observer for Discard<'_> {
    fn cancelled(&mut self, instance: Instance) {
        if let Some(runner) = self.0.resting(self.1.vertex(instance)) {
            runner.body.discard(instance.job);
        }
    }
}

impl State {
    /// Makes that of a cluster, for its DAGs' bodies and its processors.
    pub(crate) fn new(
        (cluster, office): (ClusterId, &Arc<Office>),
        scheduler: Scheduler,
        bodies: Vec<(Vertex, Body)>,
        (requests, after_fault): (Requests, Vec<Option<DagId>>),
        journal: Journal,
        processors: Box<[u32]>,
        levels: Option<Levels>,
    ) -> Self {
        let task_set = Arc::clone(scheduler.task_set());
        let (cores, dags) = (processors.len(), task_set.dags().len());
        let mut placement = Placement::empty(task_set.vertices(), cores);
        let workers = cores + bodies.len();
        for (vertex, body) in bodies {
            let job = 0;
            placement.replace(vertex, Box::new(Runner { body, vertex, job }));
        }
        let mut seats = vec![None; workers].into_boxed_slice();
        for (core, seat) in (0..).map(CoreId).zip(&mut seats[..cores]) {
            *seat = Some(core);
        }
        Self {
            cluster,
            office: Arc::clone(office),
            recorder: Recorder::into(Arc::clone(&task_set), journal),
            placement,
            task_set,
            scheduler,
            active: (0..cores).collect(),
            seats,
            pinned: vec![None; workers].into_boxed_slice(),
            resumed_ns: vec![0; workers].into_boxed_slice(),
            interrupted: None,
            left: Vec::with_capacity(workers),
            spare: (cores..workers).collect(),
            abandoned: Vec::with_capacity(workers),
            requests,
            opened: 0,
            after_fault,
            faults: Vec::with_capacity(dags),
            called: Vec::with_capacity(2 * cores),
            decisions: Vec::with_capacity(2 * cores),
            processors,
            levels,
            epoch_ns: u64::MAX,
            preemptions: 0,
        }
    }

    /// Returns a time of the clock on the run's time.
    pub(crate) const fn since_epoch(&self, time_ns: u64) -> u64 {
        time_ns.saturating_sub(self.epoch_ns)
    }

    /// Writes down what has happened now to an instance.
    pub(crate) fn note(&mut self, what: What, core: CoreId, vertex: Vertex) {
        self.note_at(sys::now_ns(), what, core, vertex);
    }

    /// Writes down what happened to an instance at a time on the clock.
    pub(crate) fn note_at(&mut self, time_ns: u64, what: What, core: CoreId, vertex: Vertex) {
        self.recorder.now_ns = self.since_epoch(time_ns);
        let instance = self.scheduler.instance_of(vertex);
        self.recorder.on_core(what, instance, core);
    }

    /// Lets the scheduler see what happens now, and decide.
    pub(crate) fn step(
        &mut self,
        workers: &[Worker],
        event: impl FnOnce(&mut Moment<'_>, &mut dyn Observer),
    ) {
        let now_ns = self.since_epoch(sys::now_ns());
        self.recorder.now_ns = now_ns;
        let discard = Discard(&mut self.placement, &self.task_set);
        let mut observer = (&mut self.recorder, discard);
        let mut moment = self.scheduler.at(now_ns);
        event(&mut moment, &mut observer);
        if self.office.open(self.cluster) {
            self.opened += 1;
            let (letters, cluster) = (&self.office.letters, self.cluster);
            (self.requests).serve_letters(letters, cluster, &mut moment, &mut observer);
        } else {
            self.requests.serve(&mut moment, &mut observer);
        }
        let decisions = moment.release_due(&mut observer).dispatch();
        self.decisions.clear();
        self.decisions.extend_from_slice(decisions);
        self.carry_out(workers);
    }

    /// Ends an instance's DAG because of a fault.
    pub(crate) fn fail(&mut self, workers: &[Worker], fault: Fault) {
        let instance = fault.instance;
        self.faults.push(fault);
        let handler = self.after_fault[instance.dag.index()];
        let handler =
            handler.filter(|&handler| !self.office.send(self.cluster, Request::Signal(handler)));
        self.step(workers, |moment, mut observer| {
            moment.fail(instance, &mut observer);
            if let Some(handler) = handler {
                moment.signal(handler, &mut observer);
            }
        });
    }

    /// Hands a completion over to the scheduler in the shortest way.
    #[inline]
    pub(crate) fn hand_off(&mut self, core: CoreId, vertex: Vertex) -> sched_dag::HandOff {
        let discard = Discard(&mut self.placement, &self.task_set);
        let mut observer = (&mut self.recorder, discard);
        // Not when the function returned: another one may have been quicker to the lock.
        let now_ns = sys::now_ns().saturating_sub(self.epoch_ns);
        observer.0.now_ns = now_ns;
        self.scheduler.hand_off(now_ns, core, vertex, &mut observer)
    }

    fn carry_out(&mut self, workers: &[Worker]) {
        if let Some((core, occupant)) = self.interrupted.take() {
            let now_ns = sys::now_ns();
            // It may have returned already, and wait for the lock.
            self.resumed_ns[self.active[core.index()]] = now_ns;
            self.note_at(now_ns, What::Resume, core, occupant);
        }
        let mut preempted = None;
        for place in 0..self.decisions.len() {
            let decision = self.decisions[place];
            let core = decision.core();
            let vertex = self.task_set.vertex(decision.instance());
            if let Decision::Preempt { .. } = decision {
                self.placement.set_target(core, None);
                preempted = Some(core);
            } else {
                self.placement.set_target(core, Some(vertex));
                if preempted == Some(core) {
                    self.note(What::Request, core, vertex);
                }
            }
        }
        for place in 0..self.decisions.len() {
            let core = self.decisions[place].core();
            if self.placement.must_suspend(core.index()) {
                self.suspend(core, workers);
            }
        }
        for place in 0..self.decisions.len() {
            self.call_if_wanted(self.decisions[place].core());
        }
    }

    /// Takes its instance away from a core, unless it has just ended.
    fn suspend(&mut self, core: CoreId, workers: &[Worker]) {
        let demoted = self.active[core.index()];
        if !workers[demoted].demote(self.levels, Role::Demoted) {
            return;
        }
        let Some(vertex) = self.placement.detach(core.index()) else {
            return;
        };
        self.preemptions += 1;
        self.note(What::Suspend, core, vertex);
        self.seats[demoted] = None;
        self.replace(core, workers);
        if let Some(waiting) = self.placement.suspend(vertex, demoted) {
            self.call_if_wanted(waiting);
        }
    }

    /// Gives a core a spare worker.
    pub(crate) fn replace(&mut self, core: CoreId, workers: &[Worker]) {
        let spare = self.spare.pop();
        // Each subtask has at most one started instance, and so many there are.
        self.seat(spare.expect("a worker for each subtask"), core, workers);
    }

    fn seat(&mut self, worker: Number, core: CoreId, workers: &[Worker]) {
        self.active[core.index()] = worker;
        self.seats[worker] = Some(core);
        self.pin(worker, core, workers);
    }

    /// Sees to it that a worker runs on a core's processor.
    pub(crate) fn pin(&mut self, worker: Number, core: CoreId, workers: &[Worker]) {
        let processor = self.processors[core.index()];
        if self.pinned[worker] != Some(core)
            && let Some(thread) = workers[worker].thread()
        {
            // The processor was ours at the start; if it was taken away since, the kernel
            // has chosen another one, and all still holds but for which thread delays which.
            let _ = sys::pin(thread, processor);
            self.pinned[worker] = Some(core);
        }
    }

    pub(crate) fn call_if_wanted(&mut self, core: CoreId) {
        if self.placement.is_wanted(core.index()) && !self.called.contains(&core) {
            self.called.push(core);
        }
    }

    /// Returns workers that are to look for work, `most` at a time, and forgets them.
    pub(crate) fn take_called(&mut self, most: usize) -> impl Iterator<Item = Number> + '_ {
        let (active, placement) = (&self.active, &self.placement);
        let left = self.called.len().saturating_sub(most);
        let called = self.called.drain(left..);
        // The one that makes the step has looked already.
        let called = called.filter(|core| placement.is_wanted(core.index()));
        called.map(|core| active[core.index()])
    }

    /// Returns the core that a worker is pinned to.
    pub(crate) fn core_of(&self, worker: Number) -> CoreId {
        self.pinned[worker].unwrap_or(CoreId(0))
    }

    /// Finds what a worker without an instance does next: run this, or nothing.
    pub(crate) fn find_work(&mut self, me: Number, workers: &[Worker]) -> Option<Box<Runner>> {
        let Some(core) = self.seats[me] else {
            self.spare.push(me);
            return None;
        };
        match self.placement.next(core.index()) {
            Next::Start(vertex, runner) => {
                let job = self.scheduler.instance_of(vertex).job;
                Some(self.begin(me, core, runner, job, workers))
            }
            Next::Continue(parked) => {
                self.seats[me] = None;
                self.spare.push(me);
                self.seat(parked, core, workers);
                workers[parked].promote(self.levels);
                if self.has_left(parked) {
                    workers[parked].call();
                }
                if let Some(vertex) = self.placement.current(core.index()) {
                    self.resumed_ns[parked] = sys::now_ns();
                    self.note_at(self.resumed_ns[parked], What::Resume, core, vertex);
                }
                None
            }
            Next::Nothing => None,
        }
    }

    /// Lets a worker begin an instance, as soon as the lock is free.
    #[inline]
    pub(crate) fn begin(
        &mut self,
        me: Number,
        core: CoreId,
        mut runner: Box<Runner>,
        job: u64,
        workers: &[Worker],
    ) -> Box<Runner> {
        runner.job = job;
        workers[me].run();
        self.note(What::Start, core, runner.vertex);
        runner
    }
}
