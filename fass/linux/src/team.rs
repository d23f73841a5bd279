//! The workers of a cluster, and a worker's way from one instance to the next.
//!
//! A worker calls functions in place: after a completion that hands the core its next instance, the
//! same thread goes on without a switch, a wake-up or an allocation.
//!
//! # The release thread
//!
//! The release thread is the clock of the scheduler. Each cluster has one, on its own processors.
//! It sleeps until the next event or look at budgets, at an absolute time, so releases keep to the
//! nominal grid however late one was. Idle workers should come first (`look_out`). If all cores are
//! busy, the release thread comes in time, and preempts. (Polling workers handle all timed events.)
//! Other threads wake it earlier with a request, or if the next event has moved forward. The
//! release thread makes the step and calls the workers, but runs no instances.

use std::cell::{Cell, RefCell};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::thread::JoinHandle;

use fass::platform::SubtaskRunner;
use sched_dag::engine::NextAction;
use sched_dag::{ClusterId, CoreId, Instance, Subtask, TaskSet, Vertex};

use crate::budgets::Budgets;
use crate::level::{Levels, Role};
use crate::lock::{Guard, Lock};
use crate::look_out::LookOut;
use crate::office::Office;
use crate::state::{FaultCause, Left, Number, RunTime, State};
use crate::worker::{self, Lead, Worker};
use crate::{clock, edge, panics, section, sys};

thread_local! {
    /// The team and the number of the worker on this thread.
    static OWN: RefCell<Option<(Arc<Team>, Number)>> = const { RefCell::new(None) };
    /// Whether this thread belongs to a run. Has no destructor, so an allocator may look.
    static IS_OF_RUN: Cell<bool> = const { Cell::new(false) };
}

/// Reports whether the calling thread releases or runs jobs, for an allocator that
/// [counts](crate::Linux::allocations).
///
/// ```
/// assert!(!linux::is_of_run()); // it is the app's own
/// ```
#[must_use]
pub fn is_of_run() -> bool {
    IS_OF_RUN.get()
}

/// Calls a function with the calling thread's worker; returns `None` if the thread is no worker.
pub(crate) fn with_own_worker<R>(look: impl FnOnce(&Worker) -> R) -> Option<R> {
    OWN.with_borrow(|own| own.as_ref().map(|(team, me)| look(&team.workers[*me])))
}

/// Returns the number of the plan whose instances the calling thread runs, if the thread is a
/// worker.
pub(crate) fn own_plan() -> Option<u64> {
    OWN.with_borrow(|own| own.as_ref().map(|(team, _)| team.office.plan))
}

/// Reports whether the calling thread may call the app's code. A thread that decides, or holds the
/// scheduler's lock, must not.
pub(crate) fn may_call_app() -> bool {
    !is_of_run() || edge::running().is_some()
}

/// Ends the calling thread's instance, which can neither return nor unwind, and reports whether
/// there is one. The thread must not do anything afterwards.
pub(crate) fn strand(cause: &str) -> bool {
    let own = OWN.with_borrow(Clone::clone);
    let instance = edge::running();
    own.zip(instance).is_some_and(|((team, me), instance)| {
        // The thread is about to take the lock, so it must not call the app's code any more.
        edge::note_running(None);
        team.strand(me, instance, cause);
        true
    })
}

/// The state shared by the threads of a cluster.
pub(crate) struct Team {
    state: Lock<State>,
    pub(crate) workers: Box<[Worker]>,
    pub(crate) levels: Option<Levels>,
    /// Whether a worker can be demoted.
    demotes: bool,
    polls: bool,
    skips_idle: bool,
    pub(crate) cluster: ClusterId,
    pub(crate) office: Arc<Office>,
    pub(crate) look_out: LookOut,
    /// The instant at which the release thread looks of its own accord.
    pub(crate) looks_at_ns: AtomicU64,
    /// How many threads have begun.
    begun: AtomicU32,
    /// By vertex, the processor time of its instance; empty if no subtask waits.
    pub(crate) turns: Box<[TurnClock]>,
}

/// The processor time of an instance of a waiting subtask.
pub(crate) struct TurnClock {
    /// The processor time of its completed turns.
    pub(crate) taken_ns: AtomicU64,
    budget_ns: u64,
}

impl TurnClock {
    /// Makes a clock for each vertex, if any subtask waits. The limit is the subtask's budget, or
    /// `wcets` times its WCET.
    fn all(task_set: &TaskSet, wcets: u64) -> Box<[Self]> {
        let subtasks = || task_set.dags().iter().flat_map(|dag| dag.subtasks());
        if subtasks().all(|subtask| subtask.waits().is_empty()) {
            return Box::default();
        }
        let clock = |subtask: &Subtask| Self {
            taken_ns: AtomicU64::new(0),
            budget_ns: subtask.most_execution_ns(wcets),
        };
        subtasks().map(clock).collect()
    }
}

impl Team {
    /// Makes the team. Two flags say whether idle threads poll, and whether the run's time skips
    /// idle intervals.
    pub(crate) fn new(
        mut state: State,
        office: &Arc<Office>,
        (polls, skips_idle): (bool, bool),
        budget_factor: u64,
    ) -> Self {
        let subtasks = state.engine.task_set.dags().iter();
        let mut subtasks = subtasks.flat_map(|dag| dag.subtasks());
        state.port.demotes |= subtasks.any(|of| of.most_execution_ns(budget_factor) < u64::MAX);
        let is_owned =
            state.levels.is_none() && !state.port.demotes && state.port.active.len() == 1;
        let workers = state.seats.iter().map(|_| Worker::new(polls));
        Self {
            turns: TurnClock::all(&state.engine.task_set, budget_factor),
            workers: workers.collect(),
            polls,
            skips_idle,
            levels: state.levels,
            demotes: state.port.demotes,
            cluster: state.engine.cluster,
            office: Arc::clone(office),
            look_out: LookOut::new(polls),
            looks_at_ns: AtomicU64::new(u64::MAX),
            begun: AtomicU32::new(0),
            state: Lock::new(state, polls, is_owned),
        }
    }

    /// Takes the scheduler's lock.
    pub(crate) fn lock(&self) -> Guard<'_, State> {
        self.state.enter()
    }

    /// Takes the scheduler's lock, as a worker.
    #[inline]
    fn lock_as(&self, me: Number) -> Guard<'_, State> {
        match me {
            OWNER => self.state.enter_as_owner(),
            _ => self.state.enter(),
        }
    }

    /// Counts the calling thread as ready for the run.
    pub(crate) fn say_ready(&self) {
        self.begun.fetch_add(1, Ordering::Release);
        sys::wake(&self.begun, i32::MAX);
    }

    /// Waits until so many threads are ready.
    pub(crate) fn wait_until_ready(&self, threads: usize) {
        loop {
            let begun = self.begun.load(Ordering::Acquire);
            if begun as usize >= threads {
                return;
            }
            sys::wait(&self.begun, begun, None);
        }
    }

    /// Begins the run's time at an instant, and from now on lets the workers look out for that
    /// instant. Only the thread starting the run calls this: the release thread may come later than
    /// the instant, and where idle workers watch, only workers handle events.
    pub(crate) fn begin(&self, epoch_ns: u64) {
        let mut state = self.lock();
        state.port.time = RunTime::beginning(epoch_ns);
        self.look_out.announce(epoch_ns);
        let cores = state.port.active.len();
        drop(state);
        self.workers[..cores].iter().for_each(Worker::call);
        self.office.ring(self.cluster);
    }

    /// Begins the thread of a worker.
    pub(crate) fn begin_worker(self: &Arc<Self>, me: Number) -> JoinHandle<()> {
        let team = Arc::clone(self);
        worker::begin(me, move || team.work(me))
    }

    /// Works until all jobs have ended.
    pub(crate) fn work(self: Arc<Self>, me: Number) {
        IS_OF_RUN.set(true);
        OWN.set(Some((Arc::clone(&self), me)));
        let worker = &self.workers[me];
        worker.register_thread();
        worker.bring(self.levels, Role::Run);
        sys::make_timers_exact();
        let mut lead = Lead::default();
        let mut state = self.lock_as(me);
        if let Some(core) = state.seats[me] {
            state.pin(me, core, &self.workers);
        }
        drop(state);
        self.say_ready();
        loop {
            let mut next = match self.wait(me, &mut lead) {
                Woken::ToEnd => return,
                Woken::WithWork(runner) => Some(runner),
                Woken::ByCall => {
                    let mut state = self.lock_as(me);
                    if let Some(left) = state.take_left(me) {
                        self.report(me, state, left.runner, Ok(()), left.finish_ns)
                    } else {
                        let now_ns = state.now_ns();
                        let next = (state.seats[me])
                            .and_then(|_| state.find_work(me, &self.workers, now_ns));
                        self.settle(me, &state, next.is_some());
                        next
                    }
                }
                Woken::ByTime => {
                    let mut state = self.lock_as(me);
                    let core = state.seats[me];
                    // This core first: the workers of other idle cores may still sleep.
                    state.step(&self.workers, |moment| {
                        core.into_iter().for_each(|core| moment.prefer(core));
                    });
                    let now_ns = state.engine.scheduler.now_ns();
                    core.and_then(|_| self.go_on(me, state, now_ns))
                }
            };
            while next.is_some() {
                if let Err(Abandoned) = self.run_on(me, &mut next) {
                    return section::forget();
                }
            }
        }
    }

    /// Sleeps until there is something to do: work or, on behalf of the worker's core, an event.
    fn wait(&self, me: Number, lead: &mut Lead) -> Woken {
        let (worker, core) = (&self.workers[me], self.workers[me].seat());
        let woken = loop {
            let next_ns = core.map_or(u64::MAX, |core| {
                let next_ns = self.look_out.next_ns();
                self.look_out.of_worker(core, next_ns)
            });
            let was_called = worker.wait_for_call(next_ns, lead);
            if was_called && let Some(runner) = worker.take_given() {
                break Woken::WithWork(runner);
            }
            if self.office.is_over() {
                break Woken::ToEnd;
            }
            if was_called {
                break Woken::ByCall;
            }
            // The event may have been handled, or another thread looks first.
            let next_ns = self.look_out.next_ns();
            let own_ns = core.map_or(u64::MAX, |core| self.look_out.of_worker(core, next_ns));
            let now_ns = clock::now_ns();
            if own_ns <= now_ns && self.look_out.claim(now_ns) {
                break Woken::ByTime;
            }
        };
        if let Some(core) = core {
            self.look_out.leave(core);
        }
        woken
    }

    /// Calls functions one after the other, as long as the scheduler has one. A panic ends the loop
    /// and the instance. Catching panics costs time, so a single catch surrounds all the calls.
    fn run_on(&self, me: Number, next: &mut Option<Box<SubtaskRunner>>) -> Result<(), Abandoned> {
        let message = match panics::caught(|| self.run_all(me, next)) {
            Ok(done) => return done,
            Err(message) => message,
        };
        edge::note_running(None);
        match next.take() {
            // The panic did not come from a function of an instance.
            None => std::panic::resume_unwind(Box::new(message)),
            Some(runner) => {
                *next = self.complete(me, runner, Err(FaultCause::Panic(message)))?;
                Ok(())
            }
        }
    }

    /// Calls the functions. The caller keeps each runner until the runner's function has returned.
    #[inline]
    fn run_all(&self, me: Number, next: &mut Option<Box<SubtaskRunner>>) -> Result<(), Abandoned> {
        while let Some(runner) = next {
            edge::note_running(Some(runner.instance));
            let outcome = match self.turns.get(runner.vertex.index()) {
                Some(clock) if runner.body.may_wait() => Self::take_turn(runner, clock),
                _ => {
                    runner.run();
                    Ok(())
                }
            };
            edge::note_running(None);
            let Some(runner) = next.take() else { break };
            *next = match self.demotes || outcome.is_err() {
                true => self.complete(me, runner, outcome)?,
                false => self.pass_on(me, runner),
            };
        }
        Ok(())
    }

    /// Runs a turn of an instance, and adds the turn's processor time to the time of earlier turns.
    fn take_turn(runner: &mut SubtaskRunner, clock: &TurnClock) -> Result<(), FaultCause> {
        let goes_on = runner.body.goes_on(runner.instance.job);
        let before_ns = clock.taken_ns.load(Ordering::Relaxed);
        let before_ns = if goes_on { before_ns } else { 0 };
        clock.taken_ns.store(before_ns, Ordering::Relaxed);
        let began_ns = sys::own_processor_time_ns();
        runner.run();
        let taken_ns = before_ns + sys::own_processor_time_ns().saturating_sub(began_ns);
        clock.taken_ns.store(taken_ns, Ordering::Relaxed);
        match taken_ns > clock.budget_ns {
            true => Err(FaultCause::Overrun),
            false => Ok(()),
        }
    }

    /// Reports that a worker's instance has finished, where workers are never demoted, and finds
    /// the worker's next instance.
    #[inline(always)]
    fn pass_on(&self, me: Number, runner: Box<SubtaskRunner>) -> Option<Box<SubtaskRunner>> {
        let finish_ns = clock::now_ns();
        let mut state = self.lock_as(me);
        let Some(core) = state.seats[me] else {
            return self.report(me, state, runner, Ok(()), finish_ns);
        };
        let end_ns = state.end_of(me, finish_ns);
        match state.end((core, me), runner, end_ns, &self.workers) {
            NextAction::Run(runner) if state.changes_nothing_else() => {
                state.hand_offs += 1;
                Some(runner)
            }
            action => self.after_end((core, me), state, action, end_ns),
        }
    }

    /// Reports that a worker's instance has ended, and finds the worker's next instance.
    pub(crate) fn complete(
        &self,
        me: Number,
        runner: Box<SubtaskRunner>,
        outcome: Result<(), FaultCause>,
    ) -> Result<Option<Box<SubtaskRunner>>, Abandoned> {
        let finish_ns = clock::now_ns();
        let workers = &self.workers;
        let is_raised = workers[me].report(self.levels);
        let mut state = self.lock_as(me);
        if is_raised {
            // The worker keeps its core until it waits: nobody at its level preempts it.
            workers[me].bring(self.levels, Role::Run);
        }
        // The release thread has ended this instance for its budget meanwhile.
        if state.abandoned.contains(&me) {
            return Err(Abandoned);
        }
        if outcome.is_ok() && state.must_leave(me, workers) {
            state.left.push(Left {
                worker: me,
                runner,
                finish_ns,
            });
            workers[me].sit(None);
            return Ok(None);
        }
        Ok(self.report(me, state, runner, outcome, finish_ns))
    }

    /// Tells the scheduler that a worker's instance has ended, and finds the worker's next
    /// instance.
    pub(crate) fn report(
        &self,
        me: Number,
        mut state: Guard<'_, State>,
        mut runner: Box<SubtaskRunner>,
        outcome: Result<(), FaultCause>,
        finish_ns: u64,
    ) -> Option<Box<SubtaskRunner>> {
        let (workers, vertex) = (&self.workers, runner.vertex);
        let state_now = &mut *state;
        let seat = state_now.seats[me];
        match (outcome, seat) {
            (Ok(()), Some(core)) => {
                let end_ns = state_now.end_of(me, finish_ns);
                let action = state_now.end((core, me), runner, end_ns, workers);
                return self.after_end((core, me), state, action, end_ns);
            }
            (Ok(()), None) => state_now.end_parked(me, runner, finish_ns, workers),
            (Err(cause), _) => {
                let core = seat.unwrap_or_else(|| state_now.core_of(me));
                runner.body.failed(finish_ns);
                match seat {
                    Some(core) => (state_now.engine.placement).finish(core.index(), vertex, runner),
                    None => state_now.engine.placement.finish_parked(vertex, runner),
                }
                let runner = state_now.engine.placement.take(vertex);
                state_now.fail(workers, (core, vertex), runner, cause);
            }
        }
        if let Some(core) = seat {
            state_now.report_left(core, workers);
        }
        let now_ns = state.now_ns();
        self.go_on(me, state, now_ns)
    }

    /// Finds a worker's next instance after the end of its core's instance.
    fn after_end(
        &self,
        (core, me): (CoreId, Number),
        mut state: Guard<'_, State>,
        action: NextAction<Box<SubtaskRunner>>,
        end_ns: u64,
    ) -> Option<Box<SubtaskRunner>> {
        match action {
            NextAction::Run(runner) => {
                state.hand_offs += 1;
                self.announce(&state);
                self.call(state);
                return Some(runner);
            }
            NextAction::Look { .. } => {}
            NextAction::Step(ended) => {
                let (engine, mut port) = state.parts(&self.workers);
                engine.step((end_ns, core), &mut port, |moment| {
                    ended.into_iter().for_each(|turn| moment.end_turn(turn));
                });
                state.carry_out(&self.workers);
            }
        }
        state.report_left(core, &self.workers);
        self.go_on(me, state, end_ns)
    }

    /// Ends a worker's step at an instant: finds the worker's next instance, and calls others.
    fn go_on(
        &self,
        me: Number,
        mut state: Guard<'_, State>,
        now_ns: u64,
    ) -> Option<Box<SubtaskRunner>> {
        let mut next = state.find_work(me, &self.workers, now_ns);
        if next.is_none()
            && self.skips_idle
            && let Some(now_ns) = state.skip_to_next_event(now_ns)
        {
            let core = state.seats[me];
            state.step_at(now_ns, &self.workers, |moment| {
                core.into_iter().for_each(|core| moment.prefer(core));
            });
            next = core.and_then(|_| state.find_work(me, &self.workers, now_ns));
        }
        self.settle(me, &state, next.is_some());
        self.announce(&state);
        self.call(state);
        next
    }

    /// Notes a worker's core. Without work, the worker looks out for that core.
    fn settle(&self, me: Number, state: &State, has_work: bool) {
        let seat = state.seats[me];
        self.workers[me].sit(seat);
        if let (Some(core), false) = (seat, has_work) {
            self.look_out.rest(core);
        }
    }

    /// Gives the lock back, and makes the workers of all cores that should run something look for
    /// work.
    pub(crate) fn call<'a>(&'a self, mut state: Guard<'a, State>) {
        if self.polls && !state.calls_none() {
            state.give(&self.workers);
        }
        if state.calls_none() {
            return;
        }
        let mut called = [None; AT_ONCE];
        loop {
            called.fill(None);
            for (place, worker) in called.iter_mut().zip(state.take_called(AT_ONCE)) {
                *place = Some(worker);
            }
            let bell = state.port.rung.pop();
            let has_more = called[AT_ONCE - 1].is_some() || !state.port.rung.is_empty();
            drop(state);
            if let Some(bell) = bell {
                sys::wake(&bell, i32::MAX);
            }
            for worker in called.into_iter().flatten() {
                self.workers[worker].call();
            }
            if !has_more {
                return;
            }
            state = self.lock();
        }
    }

    /// Makes sure that the release thread looks in time.
    #[inline]
    pub(crate) fn announce(&self, state: &State) {
        let next_ns = match state.engine.scheduler.next_event_ns() {
            Some(next_ns) => state.port.time.on_clock(next_ns),
            None if state.engine.scheduler.is_finished() => 0,
            None => u64::MAX,
        };
        self.announce_at(next_ns);
    }

    /// Makes sure that the release thread looks in time for an event at `next_ns`.
    #[inline]
    pub(crate) fn announce_at(&self, next_ns: u64) {
        self.look_out.announce(next_ns);
        if self.look_out.is_late(&self.looks_at_ns, next_ns) {
            self.looks_at_ns.store(next_ns, Ordering::SeqCst);
            self.office.ring(self.cluster);
        }
    }
}

/// Why a worker has stopped sleeping.
enum Woken {
    /// An instance was started for the worker.
    WithWork(Box<SubtaskRunner>),
    /// The worker's core may have work.
    ByCall,
    /// An event is due.
    ByTime,
    /// All jobs have ended.
    ToEnd,
}

/// The worker owning the scheduler's lock, where the lock can have an owner: the worker of the
/// first core.
const OWNER: Number = 0;

/// The most workers called before the lock is taken again.
const AT_ONCE: usize = 16;

/// The worker's instance was ended while running.
pub(crate) struct Abandoned;

impl Team {
    /// Makes the scheduler's steps until all jobs have ended.
    pub(crate) fn release(&self, mut budgets: Budgets) {
        IS_OF_RUN.set(true);
        sys::make_timers_exact();
        if self.lock().engine.task_set.is_divided() {
            // If this thread were woken on another cluster's processor, that cluster would wait.
            let _ = sys::confine(sys::thread(), &self.lock().processors);
        }
        if let Some(levels) = self.levels {
            levels.bring(sys::thread(), Role::Release);
        }
        self.say_ready();
        let alarm = self.office.alarm(self.cluster);
        let mut rests = false;
        loop {
            let seen = alarm.load(Ordering::Acquire);
            let mut state = self.lock();
            let budgets_ns = self.step_in_time(&mut state, &mut budgets, &mut rests);
            self.call(state);
            match budgets_ns {
                Some(budgets_ns) => self.sleep(seen, budgets_ns),
                None => return,
            }
        }
    }

    /// Sleeps until another thread rings, or until an event or the look at budgets is due. An event
    /// already handled by a worker does not count.
    fn sleep(&self, seen: u32, budgets_ns: u64) {
        let alarm = self.office.alarm(self.cluster);
        while alarm.load(Ordering::Acquire) == seen {
            let looks_at_ns = self.settle_look(budgets_ns);
            if clock::now_ns() < looks_at_ns {
                let until_ns = (looks_at_ns < u64::MAX).then_some(looks_at_ns);
                sys::wait(alarm, seen, until_ns);
            }
            let now_ns = clock::now_ns();
            let own_ns = self.look_out.of_release(self.look_out.next_ns(), now_ns);
            if own_ns <= now_ns && self.look_out.claim(now_ns) || budgets_ns <= now_ns {
                return;
            }
        }
    }

    /// Settles when the release thread looks next. A thread moving the next event forward first
    /// writes the event and then reads our look; we first write our look and then read the event.
    /// So one of the two threads sees the other's write.
    pub(crate) fn settle_look(&self, budgets_ns: u64) -> u64 {
        loop {
            let next_ns = self.look_out.next_ns();
            let own_ns = self.look_out.of_release(next_ns, clock::now_ns());
            let looks_at_ns = own_ns.min(budgets_ns);
            self.looks_at_ns.store(looks_at_ns, Ordering::SeqCst);
            if self.look_out.next_ns() == next_ns {
                return looks_at_ns;
            }
        }
    }

    /// Makes one step, and returns when to look at budgets; `None` if all jobs have ended.
    fn step_in_time(
        &self,
        state: &mut Guard<'_, State>,
        budgets: &mut Budgets,
        rests: &mut bool,
    ) -> Option<u64> {
        if clock::now_ns() < state.port.time.epoch_ns {
            // Requests made before time 0 are carried out at time 0.
            return Some(state.port.time.epoch_ns);
        }
        state.step(&self.workers, |_| ());
        let taken_ns = |vertex: Vertex| {
            let clock = self.turns.get(vertex.index());
            clock.map_or(0, |clock| clock.taken_ns.load(Ordering::Relaxed))
        };
        let look_ns = loop {
            match budgets.look((state, &self.workers), taken_ns, clock::now_ns()) {
                Ok(look_ns) => break look_ns,
                Err(core) => self.abandon(state, core),
            }
        };
        self.announce(state);
        let is_finished = state.engine.scheduler.is_finished();
        let opened = std::mem::take(&mut state.port.opened);
        if !self.office.settle(rests, is_finished, opened) {
            if is_finished {
                // `announce` has said that all is over; so far only this cluster rests.
                self.look_out.announce(u64::MAX);
            }
            return Some(look_ns);
        }
        self.workers.iter().for_each(|worker| worker.call());
        None
    }

    /// Ends the instance of a worker whose thread has nothing more to do, and with the instance its
    /// DAG. If necessary another thread begins; if the system has no thread left, the panic here
    /// ends the program.
    fn strand(self: &Arc<Self>, me: Number, instance: Instance, cause: &str) {
        let workers = &self.workers;
        workers[me].report(self.levels);
        let mut state = self.lock();
        if !state.abandoned.contains(&me) {
            if let Some(number) = state.later.next() {
                // Nobody joins the thread; the run's end ends it.
                drop(self.begin_worker(number));
                state.spare.push(number);
            }
            let vertex = state.engine.task_set.vertex(instance);
            let cause = FaultCause::Panic(cause.to_owned());
            self.give_up(&mut state, me, vertex, cause);
            self.announce(&state);
        }
        self.call(state);
        workers[me].bring(self.levels, Role::Abandoned);
    }

    /// Ends a core's instance for exceeding its budget, and with the instance its DAG: its function
    /// cannot be taken back.
    pub(crate) fn abandon(&self, state: &mut Guard<'_, State>, core: CoreId) {
        let number = state.port.active[core.index()];
        let Some(vertex) = state.engine.placement.current(core.index()) else {
            return;
        };
        // An instance that has just ended was in time after all.
        if !self.workers[number].demote(self.levels, Role::Abandoned) {
            return;
        }
        self.give_up(state, number, vertex, FaultCause::Overrun);
    }

    /// Ends the instance of a worker that never gets another one. If the worker has a core, a spare
    /// worker takes it and is called, so that the spare one learns of it. Where idle workers watch,
    /// a worker unaware of its core would sleep, and only workers handle events.
    fn give_up(
        &self,
        state: &mut Guard<'_, State>,
        number: Number,
        vertex: Vertex,
        cause: FaultCause,
    ) {
        let (workers, seat) = (&self.workers, state.seats[number].take());
        let core = seat.unwrap_or_else(|| state.core_of(number));
        state.abandoned.push(number);
        workers[number].give_up_sections();
        match seat {
            Some(core) => {
                state.engine.placement.lose(core.index());
                state.replace(core, workers);
                workers[state.port.active[core.index()]].call();
            }
            None => state.engine.placement.lose_parked(vertex),
        }
        state.fail(workers, (core, vertex), None, cause);
        state.report_left(core, workers);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::thread;
    use std::time::Duration;

    use fass::{SubtaskAttributes, create_dag, finish_create_dags};

    use super::{IS_OF_RUN, may_call_app, strand};
    use crate::budgets::Budgets;
    use crate::platform::HOST;
    use crate::state::tests::MACHINE;
    use crate::{Linux, Mechanism, clock};

    /// Runs on one core, by each mechanism that needs no privilege, a job of a DAG that is released
    /// after so long and calls a function, and one of another DAG later. The release thread comes
    /// after time 0.
    fn run(after: Duration, function: fn()) {
        for mechanism in [Mechanism::Normal, Mechanism::Poll] {
            let one = MACHINE.lock();
            let machine = Linux::sharing(1, mechanism).unwrap();
            let dags = [after, after + Duration::from_millis(200)].map(|offset| {
                let (dag, period) = (create_dag(), Duration::from_secs(1));
                dag.jobs(1)
                    .period(period)
                    .relative_deadline(period)
                    .offset(offset);
                dag
            });
            dags[0].register_untyped_subtask(move |_| function(), SubtaskAttributes::default());
            dags[1].register_untyped_subtask(|_| (), SubtaskAttributes::default());
            finish_create_dags(&dags).unwrap();
            let team = Arc::clone(&HOST.take_launched().unwrap().control.teams[0]);
            drop((machine, one));
            let workers = team.lock().later.start;
            (0..workers).for_each(|worker| drop(team.begin_worker(worker)));
            team.wait_until_ready(workers);
            team.begin(clock::now_ns());
            let (releasing, budgets) = (Arc::clone(&team), Budgets::new(&team.lock(), 0));
            thread::spawn(move || releasing.release(budgets));
            // What sleeps for ever makes itself felt by the time, far beyond any delay.
            let end_ns = clock::now_ns() + 60_000_000_000;
            while !team.office.is_over() {
                assert!(clock::now_ns() < end_ns, "by {mechanism:?} all sleep");
                thread::sleep(Duration::from_millis(1));
            }
        }
    }

    #[test]
    fn a_release_thread_that_comes_after_time_0_has_workers_that_look_out() {
        run(Duration::from_millis(100), || ());
    }

    #[test]
    fn who_takes_the_place_of_one_that_is_given_up_looks_out() {
        static MAY_CALL: AtomicBool = AtomicBool::new(false);
        run(Duration::ZERO, || {
            assert!(strand("meant"));
            MAY_CALL.fetch_or(may_call_app(), Ordering::Relaxed);
            loop {
                thread::park();
            }
        });
        assert!(!MAY_CALL.load(Ordering::Relaxed));
    }

    #[test]
    fn the_thread_that_decides_calls_nothing_of_the_apps() {
        assert!(may_call_app());
        IS_OF_RUN.set(true);
        assert!(!may_call_app());
    }
}
