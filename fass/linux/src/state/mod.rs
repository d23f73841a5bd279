//! The state under the scheduler's lock, and a single step of the scheduler.
//!
//! The scheduler decides at one instant which instance each core runs.
//! [`Placement`](sched_dag::placement::Placement) keeps each core's present instance, and the
//! instance the core should have. The thread making the step takes unwanted instances from their
//! cores here. A core that has no instance but should have one is *called*: its worker comes and
//! looks.
//!
//! # Instances ending after the loss of their core
//!
//! A demoted worker runs on while its core's processor has nothing better to do (`worker`): before
//! the new active worker has begun, while the new one waits in mid-function, or after that one has
//! returned and waits for the scheduler's lock. So a *parked* instance may end. The end counts on
//! the core where the instance ran last, and in the journal a core has only one instance at a time.
//! By the core's present occupant:
//!
//! - No occupant: the parked instance resumes and ends.
//! - A preemptable occupant: the occupant loses the core for the duration of the scheduler's step.
//! - An occupant that is non-preemptive, or has returned and will report its end as soon as it gets
//!   the lock: the occupant loses nothing, and the parked end is *left*. The thread reporting the
//!   occupant's end then reports the left end, too. If the scheduler gives the parked instance a
//!   core earlier, its own thread reports the end there. In the model, the instance was suspended
//!   until then.
//! - Any occupant, if the parked instance ends by a fault: a fault takes an instance away wherever
//!   it is, and needs no core.
//!
//! # The number of workers
//!
//! At any instant each core has one active worker. A cluster has more workers for two reasons:
//!
//! - A suspended instance keeps its worker. [`most_suspended`](sched_dag::Dag::most_suspended)
//!   bounds the instances of a DAG that have started, have not ended and may be suspended,
//!   including instances with a core. So the bound holds here, too, although suspensions and
//!   resumptions come later than the scheduler's decisions. When a parked instance reports its end,
//!   its worker becomes spare only after the step, in which other instances may be suspended. But
//!   no successor has started yet, so the ended instance's place in the bound is free until then.
//! - An instance given up keeps its worker for ever. The first such instance of a DAG ends the DAG,
//!   and with it all ready or waiting instances. So any further instances given up have a core or
//!   are suspended: a DAG loses no more workers than there are cores and suspended instances of the
//!   DAG, and no more than it has subtasks.
//!
//! An instance waiting between two turns has no worker. Without preemption nothing is suspended.
//! Exceeded budgets and panics that cannot unwind cost workers. In a DAG without budgets only such
//! panics can, so the threads replacing those workers begin only when a panic takes one away.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::AtomicU32;

use fass::platform::{SubtaskRunner, at_edge};
use sched_dag::engine::{Engine, FaultCost, NextAction, PlatformPort};
use sched_dag::journal::EventKind;
use sched_dag::lifecycle::{Mailboxes, Request};
use sched_dag::placement::NextWork;
use sched_dag::{ClusterId, CoreId, DriverNotice, Instance, Moment, Preemption, Subtask, Vertex};

use crate::level::{Levels, Role};
use crate::office::Office;
use crate::worker::Worker;
use crate::{clock, edge, sys};

/// An instance that has finished but is not reported yet.
pub(crate) struct Left {
    pub(crate) worker: Number,
    pub(crate) runner: Box<SubtaskRunner>,
    /// The instant on the clock at which its function returned.
    pub(crate) finish_ns: u64,
}

/// The number of a worker.
pub(crate) type Number = usize;

/// The cause of a fault.
pub(crate) enum FaultCause {
    /// A panic, with its message.
    Panic(String),
    /// An exceeded budget.
    Overrun,
}

/// A fault of an instance.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The failed instance.
    pub instance: Instance,
    /// The core, counted within its cluster.
    pub core: CoreId,
    /// The cause, in words.
    pub cause: Cow<'static, str>,
    /// The place of a panic: `file:line:column`.
    pub place: Option<String>,
    /// Whether the instance has exceeded its budget. If its function has not returned, it runs on,
    /// delaying nobody, and no other function can take over: the cost is the DAG.
    pub is_overrun: bool,
    /// The cost.
    pub cost: FaultCost,
}

/// The scheduler of a cluster, the bodies of its subtasks, and the assignment of instances to
/// workers.
pub(crate) struct State {
    pub(crate) port: PortState,
    pub(crate) engine: Engine<Box<SubtaskRunner>, Number>,
    /// By worker: the core for which the worker is active.
    pub(crate) seats: Box<[Option<CoreId>]>,
    /// By worker: the core on whose processor the worker is pinned.
    pinned: Box<[Option<CoreId>]>,
    /// By worker: the earliest end of its instance, namely its latest start or resumption, or the
    /// latest step that another thread wrote down under the same core.
    resumed_ns: Box<[u64]>,
    /// The core and vertex whose processor a worker has just taken in order to report an end.
    interrupted: Option<(CoreId, Vertex)>,
    /// Instances that finished after losing their core, and are not reported yet.
    pub(crate) left: Vec<Left>,
    /// Workers without a core and without an instance.
    pub(crate) spare: Vec<Number>,
    /// Workers whose threads have not begun. A thread begins when a panic has taken another worker
    /// away.
    pub(crate) later: Range<Number>,
    /// Workers whose instance has exceeded its budget, or cannot unwind. They are never used again.
    pub(crate) abandoned: Vec<Number>,
    pub(crate) faults: Vec<Fault>,
    /// The cores whose workers have to look for work.
    called: Vec<CoreId>,
    pub(crate) processors: Box<[u32]>,
    pub(crate) levels: Option<Levels>,
    pub(crate) preemptions: u64,
    /// How many completions gave their own core the next instance.
    pub(crate) hand_offs: u64,
    /// How many times a worker was called, or was left an instance. Where workers sleep, each time
    /// costs a wake-up by the kernel.
    pub(crate) calls: u64,
}

/// The part of a cluster's state needed by the engine's port.
pub(crate) struct PortState {
    office: Arc<Office>,
    cluster: ClusterId,
    /// By core: the active worker, running the instance the core should run.
    pub(crate) active: Box<[Number]>,
    pub(crate) time: RunTime,
    /// How many letters were taken but not settled by the release thread yet.
    pub(crate) opened: u64,
    /// Words on which driver threads may sleep: a question was just posted for each of these
    /// threads.
    pub(crate) rung: Vec<Arc<AtomicU32>>,
    /// Whether a worker can be demoted: instances can be preempted, or have budgets.
    pub(crate) demotes: bool,
}

/// The time of a cluster's run, derived from the clock.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RunTime {
    /// Time 0 on the clock; `u64::MAX` until the run has begun.
    pub(crate) epoch_ns: u64,
    /// The idle time skipped so far.
    skipped_ns: u64,
}

impl RunTime {
    const NOT_BEGUN: Self = Self::beginning(u64::MAX);

    /// Makes the time of a run that begins at `epoch_ns` on the clock.
    pub(crate) const fn beginning(epoch_ns: u64) -> Self {
        let skipped_ns = 0;
        Self {
            epoch_ns,
            skipped_ns,
        }
    }

    /// Converts a time on the clock into a time of the run. Times before time 0 become 0.
    const fn of_run(self, clock_ns: u64) -> u64 {
        clock_ns.saturating_sub(self.epoch_ns) + self.skipped_ns
    }

    /// Converts a time of the run into a time on the clock.
    pub(crate) const fn on_clock(self, time_ns: u64) -> u64 {
        (time_ns.saturating_sub(self.skipped_ns)).saturating_add(self.epoch_ns)
    }
}

/// Linux below a cluster's engine: its clock, its threads, and the office.
pub(crate) struct ThreadPort<'s> {
    state: &'s mut PortState,
    workers: &'s [Worker],
}

impl PlatformPort<Box<SubtaskRunner>> for ThreadPort<'_> {
    /// The events passed on to the edge, for recorded topics.
    const HEARS: &'static [EventKind] = fass::edge::HEARS;

    fn hear(&mut self, notice: &DriverNotice) {
        at_edge::happened(notice);
    }

    fn now_ns(&self) -> u64 {
        self.state.time.of_run(clock::now_ns())
    }

    fn on_clock(&self, time_ns: u64) -> u64 {
        self.state.time.on_clock(time_ns)
    }

    #[inline]
    fn start(&mut self, core: CoreId, _: &mut Box<SubtaskRunner>, instant_ns: u64) -> u64 {
        if self.state.demotes {
            self.workers[self.state.active[core.index()]].run();
        }
        instant_ns
    }

    /// Notes the bell of a sleeping driver thread. The thread is woken after the lock has been
    /// given back.
    fn wait(&mut self, _: CoreId, runner: &mut Box<SubtaskRunner>, _: u64) {
        self.state.rung.extend(runner.body.bell());
    }

    fn forward(&mut self, request: Request) -> bool {
        self.state.office.send(Some(self.state.cluster), request)
    }

    #[inline]
    fn has_letters(&self) -> bool {
        self.state.office.has_letters(self.state.cluster)
    }

    fn take_letters(&mut self) -> Option<&Mailboxes> {
        let letters = self.state.office.open(self.state.cluster);
        self.state.opened += letters;
        (letters > 0).then_some(&self.state.office.letters)
    }
}

impl State {
    /// Makes the state of a cluster, for its DAGs' bodies and its processors.
    pub(crate) fn new(
        mut engine: Engine<Box<SubtaskRunner>, Number>,
        office: &Arc<Office>,
        runners: Vec<SubtaskRunner>,
        processors: Box<[u32]>,
        budget_factor: u64,
    ) -> Self {
        let (cores, subtasks) = (processors.len(), runners.len());
        let later = workers(&engine, cores, budget_factor);
        let workers = later.end;
        let mut spare = Vec::with_capacity(workers);
        spare.extend(cores..later.start);
        for runner in runners {
            engine.put(runner.vertex, Box::new(runner));
        }
        let mut seats = vec![None; workers].into_boxed_slice();
        for (core, seat) in (0..).map(CoreId).zip(&mut seats[..cores]) {
            *seat = Some(core);
        }
        let port = PortState {
            office: Arc::clone(office),
            cluster: engine.cluster,
            active: (0..cores).collect(),
            time: RunTime::NOT_BEGUN,
            opened: 0,
            rung: Vec::with_capacity(subtasks),
            demotes: engine.scheduler.options().preemption == Preemption::Enabled,
        };
        Self {
            port,
            engine,
            seats,
            pinned: vec![None; workers].into_boxed_slice(),
            resumed_ns: vec![0; workers].into_boxed_slice(),
            interrupted: None,
            left: Vec::with_capacity(workers),
            spare,
            later,
            abandoned: Vec::with_capacity(workers),
            // If no fault is survived, each subtask has one fault at most.
            faults: Vec::with_capacity(subtasks),
            called: Vec::with_capacity(2 * cores),
            processors,
            levels: office.levels,
            preemptions: 0,
            hand_offs: 0,
            calls: 0,
        }
    }

    /// Converts a time on the clock into a time of the run.
    pub(crate) const fn since_epoch(&self, time_ns: u64) -> u64 {
        self.port.time.of_run(time_ns)
    }

    /// Begins the instant of the clock's present time, and returns it, or the latest instant
    /// written down if that is later: another thread may have read the clock later.
    pub(crate) fn now_ns(&mut self) -> u64 {
        let now_ns = self.since_epoch(clock::now_ns());
        self.begin(now_ns)
    }

    /// Begins the instant of a time already read, like [`now_ns`](Self::now_ns).
    pub(crate) fn begin(&mut self, read_ns: u64) -> u64 {
        let _ = self.engine.scheduler.at(read_ns);
        self.engine.scheduler.now_ns()
    }

    /// If nothing runs, makes the next event due now, and returns its instant.
    pub(crate) fn skip_to_next_event(&mut self, now_ns: u64) -> Option<u64> {
        let mut cores = 0..self.port.active.len();
        let is_idle = |core| {
            self.engine.placement.current(core).is_none() && !self.engine.placement.is_wanted(core)
        };
        let has_begun = now_ns > 0;
        let next_ns = self.engine.scheduler.next_event_ns()?;
        if !has_begun || !cores.all(is_idle) {
            return None;
        }
        self.port.time.skipped_ns += next_ns.saturating_sub(now_ns);
        Some(next_ns.max(now_ns))
    }

    /// Writes down an event of an instance as happening now, and returns the instant.
    pub(crate) fn note(&mut self, what: EventKind, core: CoreId, vertex: Vertex) -> u64 {
        let now_ns = self.now_ns();
        self.engine.note(what, core, vertex, now_ns);
        now_ns
    }

    /// Returns the engine, and the port for a step of the engine.
    #[inline]
    pub(crate) fn parts<'s>(
        &'s mut self,
        workers: &'s [Worker],
    ) -> (&'s mut Engine<Box<SubtaskRunner>, Number>, ThreadPort<'s>) {
        let state = &mut self.port;
        (&mut self.engine, ThreadPort { state, workers })
    }

    /// Takes note that the instance of a core and its worker has ended, at a time of the run.
    #[inline(always)]
    pub(crate) fn end(
        &mut self,
        (core, me): (CoreId, Number),
        runner: Box<SubtaskRunner>,
        end_ns: u64,
        workers: &[Worker],
    ) -> NextAction<Box<SubtaskRunner>> {
        // No hand-off while an end is left: only the longer way reports such ends.
        let is_alone = self.left.is_empty();
        let (engine, mut port) = self.parts(workers);
        let ended = (core, runner.vertex);
        let next = engine.complete(ended, runner, end_ns, is_alone, &mut port);
        self.resumed_ns[me] = self.engine.scheduler.now_ns();
        next
    }

    /// Shows the scheduler an event that happens now, and lets the scheduler decide.
    pub(crate) fn step(&mut self, workers: &[Worker], event: impl FnOnce(&mut Moment<'_>)) {
        let now_ns = self.now_ns();
        self.step_at(now_ns, workers, event);
    }

    /// Shows the scheduler an event at an instant, and lets the scheduler decide.
    pub(crate) fn step_at(
        &mut self,
        now_ns: u64,
        workers: &[Worker],
        event: impl FnOnce(&mut Moment<'_>),
    ) {
        let (engine, mut port) = self.parts(workers);
        let here = engine.scheduler.log.here;
        engine.step((now_ns, here), &mut port, event);
        self.resumed_ns[self.port.active[here.index()]] = self.engine.scheduler.now_ns();
        self.carry_out(workers);
    }

    /// Ends an instance because of a fault, and with the instance its job or its DAG. The DAG ends
    /// if the worker has not given the instance's runner back.
    pub(crate) fn fail(
        &mut self,
        workers: &[Worker],
        (core, vertex): (CoreId, Vertex),
        runner: Option<Box<SubtaskRunner>>,
        cause: FaultCause,
    ) {
        let (cause, is_overrun) = match cause {
            FaultCause::Panic(message) => (message.into(), false),
            FaultCause::Overrun => ("its budget was exceeded".into(), true),
        };
        let instance = self.engine.scheduler.instance_of(vertex);
        at_edge::failed(instance, clock::now_ns());
        let now_ns = self.now_ns();
        let (engine, mut port) = self.parts(workers);
        let cost = engine.fail((now_ns, core), vertex, runner, &mut port);
        // The core's present instance may have returned already, as the failed instance may have
        // lost the core.
        self.resumed_ns[self.port.active[core.index()]] = self.engine.scheduler.now_ns();
        self.faults.push(Fault {
            instance,
            core,
            cause,
            place: edge::place_of(instance),
            is_overrun,
            cost,
        });
        self.carry_out(workers);
    }

    pub(crate) fn carry_out(&mut self, workers: &[Worker]) {
        if let Some((core, occupant)) = self.interrupted.take() {
            // The occupant may have returned already, and wait for the lock.
            let now_ns = self.note(EventKind::Resume, core, occupant);
            self.resumed_ns[self.port.active[core.index()]] = now_ns;
        }
        for place in 0..self.engine.decisions().len() {
            let core = self.engine.decisions()[place].core;
            if self.engine.placement.must_suspend(core.index()) {
                self.suspend(core, workers);
            }
        }
        // Only now: a core is wanted once it has lost its instance.
        for place in 0..self.engine.decisions().len() {
            self.call_if_wanted(self.engine.decisions()[place].core);
        }
    }

    /// Takes a core's instance away, unless the instance has just ended.
    fn suspend(&mut self, core: CoreId, workers: &[Worker]) {
        let demoted = self.port.active[core.index()];
        if !workers[demoted].demote(self.levels, Role::Demoted) {
            return;
        }
        if self.engine.placement.current(core.index()).is_none() {
            return;
        }
        self.preemptions += 1;
        let now_ns = self.now_ns();
        let waiting = self.engine.suspend(core, now_ns, demoted);
        self.seats[demoted] = None;
        self.replace(core, workers);
        if let Some(waiting) = waiting {
            self.call_if_wanted(waiting);
        }
    }

    /// Gives a core a spare worker.
    pub(crate) fn replace(&mut self, core: CoreId, workers: &[Worker]) {
        let spare = self.spare.pop();
        // The module's head derives that the spare workers suffice.
        self.seat(spare.expect("a spare worker"), core, workers);
    }

    fn seat(&mut self, worker: Number, core: CoreId, workers: &[Worker]) {
        self.port.active[core.index()] = worker;
        self.seats[worker] = Some(core);
        self.pin(worker, core, workers);
    }

    /// Pins a worker to a core's processor.
    pub(crate) fn pin(&mut self, worker: Number, core: CoreId, workers: &[Worker]) {
        let processor = self.processors[core.index()];
        if self.pinned[worker] != Some(core)
            && let Some(thread) = workers[worker].thread()
        {
            // The processor was ours at the start. If it was taken away since, the kernel has
            // chosen another processor, and everything still holds except which thread delays
            // which.
            let _ = sys::pin(thread, processor);
            self.pinned[worker] = Some(core);
        }
    }

    fn call_if_wanted(&mut self, core: CoreId) {
        if self.engine.placement.is_wanted(core.index()) && !self.called.contains(&core) {
            self.called.push(core);
        }
    }

    /// Starts instances on the cores of watching workers, and hands these workers their runners. So
    /// the workers need not look at the state.
    pub(crate) fn give(&mut self, workers: &[Worker]) {
        let now_ns = self.engine.scheduler.now_ns();
        // What stays is called as ever: only watching workers are served here.
        let mut called = std::mem::take(&mut self.called);
        called.retain(|core| {
            let number = self.port.active[core.index()];
            let is_wanted = self.engine.placement.is_wanted(core.index());
            if !is_wanted || !workers[number].watches() {
                return is_wanted;
            }
            if let Some(runner) = self.find_work(number, workers, now_ns) {
                self.calls += 1;
                workers[number].give(runner);
            }
            false
        });
        self.called = called;
    }

    /// Reports whether no worker has to look for work, and no bell has to be rung.
    pub(crate) fn calls_none(&self) -> bool {
        self.called.is_empty() && self.port.rung.is_empty()
    }

    /// Reports whether the latest hop changes nothing else: the next event stays the same, and no
    /// bell rings.
    #[inline]
    pub(crate) fn changes_nothing_else(&mut self) -> bool {
        !self.engine.scheduler.log.take_job_event() && self.port.rung.is_empty()
    }

    /// Returns workers that have to look for work, at most `most` at a time, and forgets them.
    pub(crate) fn take_called(&mut self, most: usize) -> impl Iterator<Item = Number> + '_ {
        let (active, placement) = (&self.port.active, &self.engine.placement);
        let left = self.called.len().saturating_sub(most);
        let called = self.called.drain(left..);
        // The thread that made the step may have taken its own core's work already.
        let called = called.filter(|core| placement.is_wanted(core.index()));
        let calls = &mut self.calls;
        called
            .inspect(|_| *calls += 1)
            .map(|core| active[core.index()])
    }

    /// Returns the core to which a worker is pinned.
    pub(crate) fn core_of(&self, worker: Number) -> CoreId {
        self.pinned[worker].unwrap_or(CoreId(0))
    }

    /// Finds the next instance for a worker without an instance, at an instant; `None` if there is
    /// nothing to run.
    pub(crate) fn find_work(
        &mut self,
        me: Number,
        workers: &[Worker],
        now_ns: u64,
    ) -> Option<Box<SubtaskRunner>> {
        let Some(core) = self.seats[me] else {
            // The worker has lost its core while its instance ran.
            self.spare.push(me);
            return None;
        };
        // Another thread may just have started an instance for this core.
        if self.engine.placement.current(core.index()).is_some() {
            return None;
        }
        let now_ns = self.begin(now_ns);
        let (engine, mut port) = self.parts(workers);
        match engine.next((now_ns, core), &mut port) {
            NextWork::Start(_, runner) | NextWork::Proceed(_, runner) => {
                self.resumed_ns[me] = now_ns;
                Some(runner)
            }
            NextWork::Continue(parked) => {
                self.seats[me] = None;
                self.spare.push(me);
                self.seat(parked, core, workers);
                // Pinned before it is raised: on its former processor it would compete with that
                // core's worker.
                workers[parked].promote(self.levels);
                // Its function has returned, and it sleeps: it reports the end on the core it has
                // now.
                if self.has_left(parked) {
                    workers[parked].call();
                }
                if let Some(vertex) = self.engine.placement.current(core.index()) {
                    self.resumed_ns[parked] = self.note(EventKind::Resume, core, vertex);
                }
                None
            }
            NextWork::Nothing => None,
        }
    }
}

/// Counts the workers of a cluster. The run begins with the workers up to the start of the range;
/// the threads of the workers within the range begin later.
fn workers(
    engine: &Engine<Box<SubtaskRunner>, Number>,
    cores: usize,
    budget_factor: u64,
) -> Range<Number> {
    let is_preemptive = engine.scheduler.options().preemption == Preemption::Enabled;
    let (mut first, mut later) = (cores, 0);
    let dags = engine.task_set.dags().iter();
    for dag in dags.filter(|dag| dag.cluster() == engine.cluster) {
        let suspended = dag.most_suspended() * usize::from(is_preemptive);
        let given_up = (cores + suspended).min(dag.subtasks().len());
        let has_budget = |of: &Subtask| of.most_execution_ns(budget_factor) < u64::MAX;
        first += suspended;
        *match dag.subtasks().iter().any(has_budget) {
            true => &mut first,
            false => &mut later,
        } += given_up;
    }
    first..first + later
}

impl State {
    /// Returns an instance's end, for a worker whose function returned at `returned_ns` on the
    /// clock. If the instance lost its core and got the core back before reporting, it ends at the
    /// resumption; or at the step taken before its report, if that step is later.
    pub(crate) fn end_of(&self, worker: Number, returned_ns: u64) -> u64 {
        self.since_epoch(returned_ns).max(self.resumed_ns[worker])
    }

    /// Reports whether a worker with a finished instance has to leave the report to another thread.
    #[inline]
    pub(crate) fn must_leave(&self, worker: Number, workers: &[Worker]) -> bool {
        if self.seats[worker].is_some() {
            return false;
        }
        let core = self.core_of(worker).index();
        let occupant = self.engine.placement.current(core);
        occupant.is_some_and(|occupant| {
            let instance = self.engine.scheduler.instance_of(occupant);
            let dag = self.engine.task_set.dag(instance.dag);
            dag.subtask(instance.subtask).is_non_preemptive()
                || workers[self.port.active[core]].has_returned()
        })
    }

    /// Reports whether a worker has left its instance's end to another thread.
    fn has_left(&self, worker: Number) -> bool {
        self.left.iter().any(|left| left.worker == worker)
    }

    /// Takes the left end of a worker's instance if the worker has a core now, and so reports the
    /// end itself.
    pub(crate) fn take_left(&mut self, worker: Number) -> Option<Left> {
        self.seats[worker]?;
        let mut left = self.left.iter();
        let place = left.position(|left| left.worker == worker)?;
        Some(self.left.swap_remove(place))
    }

    /// Reports the left ends of workers that ran on a core. The core has no instance now.
    pub(crate) fn report_left(&mut self, core: CoreId, workers: &[Worker]) {
        let is_due = |state: &Self, worker: Number| {
            state.seats[worker].is_none() && state.core_of(worker).index() == core.index()
        };
        while let Some(place) = (self.left.iter()).position(|left| is_due(self, left.worker)) {
            let left = self.left.remove(place);
            self.end_parked(left.worker, left.runner, left.finish_ns, workers);
            // Spare only after the step, as the module's head counts the workers.
            self.spare.push(left.worker);
        }
    }

    /// Tells the scheduler that a parked instance has ended, on the core where the instance ran.
    /// The core's processor now runs the reporting worker, not the core's occupant.
    pub(crate) fn end_parked(
        &mut self,
        worker: Number,
        runner: Box<SubtaskRunner>,
        finish_ns: u64,
        workers: &[Worker],
    ) {
        let (core, vertex) = (self.core_of(worker), runner.vertex);
        let occupant = self.engine.placement.current(core.index());
        if let Some(occupant) = occupant {
            self.note(EventKind::Suspend, core, occupant);
        }
        self.note(EventKind::Resume, core, vertex);
        // The occupant goes on after the step caused by the end; during the step the core runs no
        // instance.
        self.interrupted = occupant.map(|occupant| (core, occupant));
        let times_ns = (self.since_epoch(finish_ns), self.now_ns());
        let (engine, mut port) = self.parts(workers);
        engine.complete_parked((core, vertex), runner, times_ns, &mut port);
        self.carry_out(workers);
    }
}

#[cfg(test)]
pub(crate) mod tests;
