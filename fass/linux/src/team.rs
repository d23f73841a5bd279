//! The workers of a run, and how one goes from an instance to the next.
//!
//! A worker calls functions in place: from a completion that hands its core the next
//! instance, the same thread goes on, without a switch, a wake or an allocation.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use sched_dag::HandOff;
use sched_dag::journal::What;

use crate::level::{Levels, Role};
use crate::requests::{Request, Requests};
use crate::state::{Number, Runner, State};
use crate::sys;
use crate::worker::Worker;

thread_local! {
    /// The run and the number of the worker that this thread is.
    static OWN: RefCell<Option<(Arc<Team>, Number)>> = const { RefCell::new(None) };
}

/// Calls a function with the worker that the calling thread is; `None` if it is none.
pub(crate) fn with_own_worker<R>(look: impl FnOnce(&Worker) -> R) -> Option<R> {
    OWN.with_borrow(|own| own.as_ref().map(|(team, me)| look(&team.workers[*me])))
}

/// All that the threads of a run share.
pub(crate) struct Team {
    state: Mutex<State>,
    pub(crate) workers: Box<[Worker]>,
    pub(crate) levels: Option<Levels>,
    pub(crate) requests: Requests,
    /// The number of the plan that runs.
    pub(crate) plan: u64,
    /// Changes whenever the release thread is to look at once.
    pub(crate) alarm: AtomicU32,
    /// When the release thread looks of its own accord.
    pub(crate) looks_at_ns: AtomicU64,
    /// 1 when all jobs have ended.
    pub(crate) over: AtomicU32,
    /// How many threads have begun.
    begun: AtomicU32,
    /// How often a completion gave its own core the next instance.
    pub(crate) hand_offs: AtomicU64,
    /// How often a worker was called, which is a wake of the kernel's.
    pub(crate) calls: AtomicU64,
}

impl Team {
    pub(crate) fn new(state: State, plan: u64) -> Self {
        Self {
            workers: state.seats.iter().map(|_| Worker::default()).collect(),
            levels: state.levels,
            requests: Requests::new(state.task_set.dags().len()),
            plan,
            alarm: AtomicU32::new(0),
            looks_at_ns: AtomicU64::new(u64::MAX),
            over: AtomicU32::new(0),
            begun: AtomicU32::new(0),
            hand_offs: AtomicU64::new(0),
            calls: AtomicU64::new(0),
            state: Mutex::new(state),
        }
    }

    /// Takes the scheduler's lock. A panic under it would be ours, and was reported.
    pub(crate) fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn is_over(&self) -> bool {
        self.over.load(Ordering::Acquire) == 1
    }

    /// Says that a thread is ready for the run.
    pub(crate) fn say_ready(&self) {
        self.begun.fetch_add(1, Ordering::Release);
        sys::wake(&self.begun, i32::MAX);
    }

    /// Waits until so many threads are.
    pub(crate) fn wait_until_ready(&self, threads: usize) {
        loop {
            let begun = self.begun.load(Ordering::Acquire);
            if begun as usize >= threads {
                return;
            }
            sys::wait(&self.begun, begun, None);
        }
    }

    /// Leaves a request to the release thread.
    pub(crate) fn request(&self, dag: sched_dag::DagId, request: Request) {
        self.requests.leave(dag, request);
        self.ring();
    }

    /// Makes the release thread look at once.
    pub(crate) fn ring(&self) {
        self.alarm.fetch_add(1, Ordering::Release);
        sys::wake(&self.alarm, 1);
    }

    /// Works until all jobs have ended.
    pub(crate) fn work(self: Arc<Self>, me: Number) {
        OWN.set(Some((Arc::clone(&self), me)));
        let worker = &self.workers[me];
        worker.begin();
        worker.bring(self.levels, Role::Run);
        let mut state = self.lock();
        if let Some(core) = state.seats[me] {
            state.pin(me, core, &self.workers);
        }
        drop(state);
        self.say_ready();
        loop {
            worker.wait_for_call();
            if self.is_over() {
                return;
            }
            let mut state = self.lock();
            let mut next = state.seats[me].and_then(|_| state.find_work(me, &self.workers));
            drop(state);
            while let Some(mut runner) = next.take() {
                let outcome = self.execute(&mut runner);
                match self.complete(me, runner, outcome) {
                    Ok(found) => next = found,
                    Err(Abandoned) => return,
                }
            }
        }
    }

    /// Calls the function; the error is a panic's message.
    #[inline]
    fn execute(&self, runner: &mut Runner) -> Result<(), String> {
        let job = runner.job;
        let body = AssertUnwindSafe(|| runner.body.run(job));
        catch_unwind(body).map_err(|panic| message(&*panic))
    }

    /// Reports that a worker's instance has ended, and finds what it does next.
    #[inline]
    fn complete(
        &self,
        me: Number,
        mut runner: Box<Runner>,
        outcome: Result<(), String>,
    ) -> Result<Option<Box<Runner>>, Abandoned> {
        let finish_ns = sys::now_ns();
        let (workers, vertex) = (&self.workers, runner.vertex);
        let is_raised = workers[me].report(self.levels);
        let mut state = self.lock();
        if is_raised {
            // It has its core until it waits: nobody at its level preempts it.
            workers[me].bring(self.levels, Role::Run);
        }
        if state.abandoned.contains(&me) {
            return Err(Abandoned);
        }
        let state_now = &mut *state;
        if outcome.is_ok() && runner.body.has_effects() {
            let signals = &mut state_now.signals;
            runner.body.complete(finish_ns, &mut |dag| {
                if !signals.contains(&dag) {
                    signals.push(dag);
                }
            });
        }
        let what = match outcome {
            Ok(()) => What::Finish,
            Err(_) => What::Ended,
        };
        match state_now.seats[me] {
            Some(core) => {
                state_now.note_at(finish_ns, what, core, vertex);
                state_now.placement.finish(core.index(), vertex, runner);
                if outcome.is_ok() && state_now.signals.is_empty() {
                    match state_now.hand_off(core, vertex) {
                        HandOff::To(successor, decision) => {
                            if let Some(runner) = state_now.placement.start(core, successor) {
                                let job = decision.instance().job;
                                let runner = state_now.begin(me, core, runner, job, workers);
                                self.hand_offs.fetch_add(1, Ordering::Relaxed);
                                self.announce(&state);
                                return Ok(Some(runner));
                            }
                            state_now.placement.set_target(core, Some(successor));
                        }
                        HandOff::Idle => {}
                        HandOff::Open => state_now.step(workers, |_, _| ()),
                    }
                    return Ok(self.go_on(me, state));
                }
            }
            None => {
                // It ran on although it was preempted, where it was then.
                state_now.note_end_of_parked(me, what, vertex);
                state_now.placement.finish_parked(vertex, runner);
            }
        }
        let instance = state_now.scheduler.instance_of(vertex);
        match outcome {
            Ok(()) => state_now.step(workers, |moment, mut observer| {
                moment.complete(instance, &mut observer);
            }),
            Err(cause) => state_now.fail(workers, instance, cause),
        }
        Ok(self.go_on(me, state))
    }

    /// Ends a worker's step: finds what it does next, and calls others.
    fn go_on(&self, me: Number, mut state: MutexGuard<'_, State>) -> Option<Box<Runner>> {
        let next = state.find_work(me, &self.workers);
        self.announce(&state);
        self.call(state);
        next
    }

    /// Gives the lock back, and makes the workers of all cores that should run something
    /// look for it.
    pub(crate) fn call<'a>(&'a self, mut state: MutexGuard<'a, State>) {
        let mut called = [None; AT_ONCE];
        loop {
            called.fill(None);
            for (place, worker) in called.iter_mut().zip(state.take_called(AT_ONCE)) {
                *place = Some(worker);
            }
            drop(state);
            for worker in called.into_iter().flatten() {
                self.calls.fetch_add(1, Ordering::Relaxed);
                self.workers[worker].call();
            }
            if called[AT_ONCE - 1].is_none() {
                return;
            }
            state = self.lock();
        }
    }

    /// Sees to it that the release thread looks in time.
    #[inline]
    pub(crate) fn announce(&self, state: &State) {
        let next_ns = state.scheduler.next_event_ns();
        let next_ns = match next_ns {
            Some(next_ns) => next_ns.saturating_add(state.epoch_ns),
            None if state.scheduler.is_finished() => 0,
            None => u64::MAX,
        };
        if next_ns < self.looks_at_ns.load(Ordering::Relaxed) {
            self.looks_at_ns.store(next_ns, Ordering::Relaxed);
            self.ring();
        }
    }
}

/// The most workers that are called before the lock is taken once more.
const AT_ONCE: usize = 16;

/// The worker's instance was ended while it ran.
struct Abandoned;

/// Returns a panic's message.
fn message(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    text.unwrap_or("a panic without a message").to_owned()
}
