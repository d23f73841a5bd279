//! Several workers, and one scheduler under a lock.
//!
//! Whoever has finished an instance takes the lock, steps the scheduler, and mostly
//! leaves with the next instance for itself. What other cores are to run it puts into
//! their mailboxes. A worker without an instance polls its mailbox; it does not look
//! at the lock, so it disturbs nobody.
//!
//! A body that is not running lies beside the scheduler, under the same lock. A worker
//! takes it out with the assignment, and puts it back with the report of the
//! completion: so it is nobody else's meanwhile, and no body has a lock of its own.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};

use sched_dag::{CoreId, DagId, Decision, HandOff, Instance, Scheduler};

use crate::execute::Execute;
use crate::mailbox::{Assignment, Mailbox};
use crate::relax::poll;
use crate::watch::Watch;

/// What all workers share.
pub(crate) struct Team<B, W> {
    state: Aligned<Mutex<State<B, W>>>,
    mailboxes: Box<[Mailbox<B>]>,
    /// Set at the end, or by a worker that panics.
    is_over: Aligned<AtomicBool>,
}

/// A value in cache lines of its own.
#[repr(align(128))]
struct Aligned<T>(T);

/// What is under the lock.
struct State<B, W> {
    scheduler: Scheduler,
    /// By vertex; a running one is with its worker.
    bodies: Box<[Option<Box<B>>]>,
    watch: W,
    now_ns: u64,
    /// How many workers have an instance.
    busy: u32,
    signals: Vec<DagId>,
    /// A copy of the last dispatch, to be carried out.
    decisions: Vec<Decision>,
}

impl<B: Execute, W: Watch> Team<B, W> {
    pub(crate) fn new(scheduler: Scheduler, bodies: Vec<B>, watch: W) -> Self {
        let cores = scheduler.options().cores as usize;
        let dags = scheduler.task_set().dags().len();
        Self {
            state: Aligned(Mutex::new(State {
                bodies: bodies.into_iter().map(|b| Some(Box::new(b))).collect(),
                watch,
                now_ns: 0,
                busy: 0,
                signals: Vec::with_capacity(dags),
                decisions: Vec::with_capacity(2 * cores),
                scheduler,
            })),
            mailboxes: (0..cores).map(|_| Mailbox::new()).collect(),
            is_over: Aligned(AtomicBool::new(false)),
        }
    }

    /// Returns the scheduler and who looked on, after all workers have returned.
    pub(crate) fn into_parts(self) -> (Scheduler, W) {
        let state = self.state.0.into_inner();
        let state = state.unwrap_or_else(PoisonError::into_inner);
        (state.scheduler, state.watch)
    }

    /// Works until all jobs have ended. Worker 0 begins.
    pub(crate) fn work(&self, core: CoreId) {
        let _over = OverOnPanic(&self.is_over.0);
        let mut own = None;
        if core == CoreId(0) {
            let mut state = self.lock();
            own = self.proceed(&mut state, core);
        }
        loop {
            let Some(mut assignment) = own.take().or_else(|| self.wait(core)) else {
                return;
            };
            assignment.body.run(assignment.job);
            own = self.report(core, assignment);
        }
    }

    /// Returns what another worker leaves for this one; `None` at the end.
    fn wait(&self, core: CoreId) -> Option<Assignment<B>> {
        let mailbox = &self.mailboxes[core.index()];
        poll(|| match mailbox.take() {
            Some(assignment) => Some(Some(assignment)),
            None => self.is_over.0.load(Ordering::Acquire).then_some(None),
        })
    }

    /// Reports a completion, and returns what this worker runs next.
    #[inline]
    fn report(&self, core: CoreId, assignment: Assignment<B>) -> Option<Assignment<B>> {
        let Assignment {
            vertex, mut body, ..
        } = assignment;
        let mut guard = self.lock();
        let state = &mut *guard;
        state.now_ns += W::STEP_NS;
        body.complete(state.now_ns, &mut |dag| state.signals.push(dag));
        state.bodies[vertex.index()] = Some(body);
        if W::STEP_NS > 0 {
            let instance = state.scheduler.instance_of(vertex);
            state.watch.instant(state.now_ns);
            state.watch.finished(instance, core);
        }
        if !state.signals.is_empty() {
            let instance = state.scheduler.instance_of(vertex);
            state.busy -= 1;
            let mut moment = state.scheduler.at(state.now_ns);
            moment.complete(instance, &mut state.watch);
            for dag in state.signals.drain(..) {
                moment.signal(dag, &mut state.watch);
            }
            return self.proceed(state, core);
        }
        match (state.scheduler).hand_off(state.now_ns, core, vertex, &mut state.watch) {
            HandOff::To(_, decision) => Some(state.assign(decision.instance(), core)),
            HandOff::Idle if state.busy > 1 => {
                state.busy -= 1;
                None
            }
            HandOff::Idle | HandOff::Open => {
                state.busy -= 1;
                self.proceed(state, core)
            }
        }
    }

    /// Ends the instant; goes on to the next release if nothing runs and nothing
    /// starts. Returns what this worker runs next.
    fn proceed(&self, state: &mut State<B, W>, core: CoreId) -> Option<Assignment<B>> {
        loop {
            let moment = state.scheduler.at(state.now_ns);
            let decisions = moment.release_due(&mut state.watch).dispatch();
            state.decisions.clear();
            state.decisions.extend_from_slice(decisions);
            if !state.decisions.is_empty() {
                return self.carry_out(state, core);
            }
            if state.busy > 0 {
                return None;
            }
            let Some(event_ns) = state.scheduler.next_event_ns() else {
                self.is_over.0.store(true, Ordering::Release);
                return None;
            };
            state.now_ns = event_ns.max(state.now_ns);
            state.watch.instant(state.now_ns);
        }
    }

    fn carry_out(&self, state: &mut State<B, W>, core: CoreId) -> Option<Assignment<B>> {
        let mut own = None;
        for index in 0..state.decisions.len() {
            let decision = state.decisions[index];
            let assignment = state.assign(decision.instance(), decision.core());
            state.busy += 1;
            if decision.core() == core {
                own = Some(assignment);
            } else {
                self.mailboxes[decision.core().index()].put(assignment);
            }
        }
        own
    }

    #[inline]
    fn lock(&self) -> MutexGuard<'_, State<B, W>> {
        poll(|| match self.state.0.try_lock() {
            Ok(guard) => Some(guard),
            // Whoever panicked in there has set `is_over`; the run ends with its panic.
            Err(TryLockError::Poisoned(poisoned)) => Some(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        })
    }
}

impl<B, W: Watch> State<B, W> {
    #[inline]
    fn assign(&mut self, instance: Instance, core: CoreId) -> Assignment<B> {
        self.watch.started(instance, core);
        let vertex = self.scheduler.vertex(instance);
        let body = self.bodies[vertex.index()].take();
        Assignment {
            vertex,
            job: instance.job,
            body: body.expect("an instance that is not ready yet was started"),
        }
    }
}

/// Sends all workers home if one panics.
struct OverOnPanic<'a>(&'a AtomicBool);

impl Drop for OverOnPanic<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.store(true, Ordering::Release);
        }
    }
}
