//! Several workers, and one scheduler under a lock: of all DAGs, or of their cluster.
//!
//! A worker that has finished an instance *posts* that in its mailbox, takes the lock, steps
//! the scheduler, and mostly leaves with the next instance for itself. What other cores
//! are to run it puts into their mailboxes. A worker without an instance polls its
//! mailbox; it does not look at the lock, so it disturbs nobody.
//!
//! # Serving
//!
//! A worker that has stepped the scheduler last, and has got nothing to run while
//! others do run, keeps the lock and *serves*: it looks into the others' mailboxes and
//! steps the scheduler for them. The scheduler's state is in its processor's cache; to
//! fetch it into that of the worker which has finished would take ten transfers of
//! cache lines, to be told takes one. And what becomes ready it runs itself. So a join
//! across cores costs little more than one transfer. In a chain nobody serves: the
//! worker that runs it has stepped the scheduler last.
//!
//! A post is taken exactly once, by the owner of the lock: a server, or the worker
//! itself, which tries the lock as long as nobody serves.
//!
//! # The order of a server's last steps
//!
//! It has seen a post, and has something to run. An atomic exchange has to wait until
//! all stores before it have arrived, also those to lines that another processor reads
//! right now. So the exchanges come first (the body's lock, the scheduler's), and then
//! the stores that others wait for: they leave while the body runs.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

use sched_dag::{CoreId, Decision, HandOff, Instance, Scheduler, Vertex};

use crate::execute::{Execute, keep_signal};
use crate::mailbox::{Assignment, Mailbox, Post};
use crate::others::Others;
use crate::relax::poll;
use crate::reports::{Line, Reports, Shared};
use crate::watch::Watch;

/// What all workers share.
pub(crate) struct Team<B, W, O> {
    state: Pair<Mutex<State<B, W>>>,
    bodies: Shared<B>,
    mailboxes: Box<[Mailbox]>,
    /// Whether the lock's owner looks into mailboxes.
    is_serving: Pair<AtomicBool>,
    /// Set at the end, or by a worker that panics.
    is_over: Pair<AtomicBool>,
    others: O,
}

/// A value in two cache lines of its own, since processors fetch them in pairs.
#[repr(align(128))]
struct Pair<T>(T);

/// What is under the lock.
struct State<B, W> {
    scheduler: Scheduler,
    reports: Reports<W, Shared<B>>,
    now_ns: u64,
    /// How many workers have an instance.
    busy: u32,
    /// By worker, the turn of its latest post that was taken note of.
    noted: Box<[u32]>,
    /// A copy of the last dispatch, to be carried out.
    decisions: Vec<Decision>,
}

impl<B: Execute, W: Watch, O: Others> Team<B, W, O> {
    pub(crate) fn new(scheduler: Scheduler, bodies: Vec<B>, watch: W, others: O) -> Self {
        let cores = scheduler.options().cores as usize;
        let dags = scheduler.task_set().dags().len();
        let bodies = bodies.into_iter().map(|body| Line(Mutex::new(body)));
        let bodies: Shared<B> = bodies.collect();
        Self {
            mailboxes: (0..cores).map(|_| Mailbox::new(dags)).collect(),
            state: Pair(Mutex::new(State {
                reports: Reports::new(scheduler.task_set(), watch, Arc::clone(&bodies)),
                scheduler,
                now_ns: 0,
                busy: 0,
                noted: vec![0; cores].into_boxed_slice(),
                decisions: Vec::with_capacity(2 * cores),
            })),
            bodies,
            is_serving: Pair(AtomicBool::new(false)),
            is_over: Pair(AtomicBool::new(false)),
            others,
        }
    }

    /// Returns the scheduler and its observer, after all workers have returned.
    pub(crate) fn into_parts(self) -> (Scheduler, W) {
        let state = self.state.0.into_inner();
        let state = state.unwrap_or_else(PoisonError::into_inner);
        (state.scheduler, state.reports.watch)
    }

    /// Works until all jobs have ended. Worker 0 begins.
    pub(crate) fn work(&self, core: CoreId) {
        let _over = OverOnPanic(&self.is_over.0);
        let mut me = Me {
            core,
            posted: None,
            assigned: 0,
        };
        let mut next = None;
        if core == CoreId(0)
            && let Some(mut state) = self.try_lock()
        {
            let own = self.proceed(&mut state, core);
            next = own.map(|assignment| self.begin(assignment));
        }
        while let Some(mut running) = next.take().or_else(|| self.wait(&mut me)) {
            running.body.run(running.job);
            let mut has_signals = false;
            let mailbox = &self.mailboxes[core.index()];
            running.body.complete(&mut |dag| {
                has_signals = true;
                keep_signal(&mut mailbox.signals(), dag);
            });
            drop(running.body);
            me.posted = Some(mailbox.post(running.vertex, has_signals));
        }
    }

    /// Takes what an assignment needs.
    #[inline]
    fn begin(&self, assignment: Assignment) -> Running<'_, B> {
        let Assignment { vertex, job } = assignment;
        let body = self.bodies[vertex.index()].0.lock();
        Running {
            vertex,
            job,
            body: body.unwrap_or_else(PoisonError::into_inner),
        }
    }

    /// Waits for the next instance of this worker, and sees to it that its post is
    /// taken note of; `None` at the end.
    #[inline]
    fn wait(&self, me: &mut Me) -> Option<Running<'_, B>> {
        let mailbox = &self.mailboxes[me.core.index()];
        poll(|| {
            if let Some(turn) = me.posted
                && !self.is_serving.0.load(Ordering::Relaxed)
            {
                if mailbox.is_hinted(turn) {
                    me.posted = None;
                } else if let Some(state) = self.try_lock() {
                    me.posted = None;
                    if let Some(own) = self.step(state, me.core, turn) {
                        return Some(Some(own));
                    }
                }
            }
            if let Some(assignment) = mailbox.assigned_after(&mut me.assigned) {
                me.posted = None;
                return Some(Some(self.begin(assignment)));
            }
            if self.others.have_knocked()
                && me.posted.is_none()
                && let Some(mut state) = self.try_lock()
                && let Some(own) = self.open(&mut state, me.core)
            {
                return Some(Some(self.begin(own)));
            }
            self.is_over.0.load(Ordering::Acquire).then_some(None)
        })
    }

    /// Takes the worker's own post, if nobody has done so meanwhile, and then
    /// serves, if it has nothing else to do. Returns what it runs next.
    #[inline]
    fn step<'a>(
        &'a self,
        mut state: MutexGuard<'a, State<B, W>>,
        core: CoreId,
        turn: u32,
    ) -> Option<Running<'a, B>> {
        if state.noted[core.index()] == turn {
            return None;
        }
        let post = self.mailboxes[core.index()].posted();
        match self.take_note(&mut state, core, core, post) {
            Some(own) => Some(self.begin(own)),
            None if state.busy > 0 => self.serve(state, core),
            None => None,
        }
    }

    /// Takes the others' posts until this worker has something to run, or
    /// nobody else has.
    fn serve<'a>(
        &'a self,
        mut state: MutexGuard<'a, State<B, W>>,
        core: CoreId,
    ) -> Option<Running<'a, B>> {
        self.is_serving.0.store(true, Ordering::Relaxed);
        for other in (0..).map(CoreId).take(self.mailboxes.len()) {
            state.scheduler.anticipate(other);
        }
        let last = poll(|| {
            for (other, mailbox) in (0..).map(CoreId).zip(&self.mailboxes) {
                let post = mailbox.posted();
                if post.turn == state.noted[other.index()] {
                    continue;
                }
                let own = self.take_note(&mut state, core, other, post);
                if own.is_some() || state.busy == 0 {
                    return Some(Some((own, Some((mailbox, post.turn)))));
                }
                mailbox.hint(post.turn);
            }
            if self.others.have_knocked()
                && let Some(own) = self.open(&mut state, core)
            {
                return Some(Some((Some(own), None)));
            }
            self.is_over.0.load(Ordering::Relaxed).then_some(None)
        });
        let (own, to_tell) = last?;
        let own = own.map(|own| self.begin(own));
        drop(state);
        if let Some((mailbox, turn)) = to_tell {
            mailbox.hint(turn);
        }
        self.is_serving.0.store(false, Ordering::Relaxed);
        own
    }

    /// Takes the post of a worker that has finished an instance. Returns what `here`, which
    /// has nothing to do, runs next.
    #[inline]
    fn take_note(
        &self,
        state: &mut State<B, W>,
        here: CoreId,
        core: CoreId,
        post: Post,
    ) -> Option<Assignment> {
        let vertex = post.vertex;
        state.noted[core.index()] = post.turn;
        state.busy -= 1;
        if W::STEP_NS > 0 {
            state.now_ns += W::STEP_NS;
            state.reports.watch.instant(state.now_ns);
            let instance = state.scheduler.instance_of(vertex);
            state.reports.watch.finished(instance, core);
        }
        let State {
            scheduler,
            reports,
            now_ns,
            ..
        } = state;
        if post.has_signals || self.others.have_knocked() {
            let instance = scheduler.instance_of(vertex);
            let mut moment = scheduler.at(*now_ns);
            moment.complete(instance, reports);
            if post.has_signals {
                for dag in self.mailboxes[core.index()].signals().drain(..) {
                    if !self.others.send(dag) {
                        moment.signal(dag, reports);
                    }
                }
            }
            return self.proceed(state, here);
        }
        let done = if core == here {
            scheduler.hand_off(*now_ns, core, vertex, reports)
        } else {
            scheduler.hand_over(*now_ns, core, vertex, here, reports)
        };
        match done {
            HandOff::To(_, decision) => Some(state.assign(decision.instance(), here)),
            HandOff::Idle if state.busy > 0 => None,
            HandOff::Idle | HandOff::Open => self.proceed(state, here),
        }
    }

    /// Makes a step because another cluster has knocked. Returns what `here` runs next.
    #[cold]
    fn open(&self, state: &mut State<B, W>, here: CoreId) -> Option<Assignment> {
        // If nobody is busy the run has not begun.
        if state.busy > 0 {
            state.now_ns += W::STEP_NS;
            state.reports.watch.instant(state.now_ns);
        }
        self.proceed(state, here)
    }

    /// Takes letters and ends the instant; goes on to the next event if nothing runs and nothing
    /// starts. Returns what `here` runs next.
    fn proceed(&self, state: &mut State<B, W>, here: CoreId) -> Option<Assignment> {
        loop {
            let mut moment = state.scheduler.at(state.now_ns);
            self.others
                .take(|dag| moment.signal(dag, &mut state.reports));
            let decisions = moment.release_due(&mut state.reports).dispatch();
            state.decisions.clear();
            state.decisions.extend_from_slice(decisions);
            if !state.decisions.is_empty() {
                return self.carry_out(state, here);
            }
            if state.busy > 0 {
                return None;
            }
            let (due_ns, then_ns) = (state.scheduler.next_event_ns(), state.now_ns + W::STEP_NS);
            let Some(event_ns) = self.others.next_ns(due_ns, then_ns) else {
                self.is_over.0.store(true, Ordering::Release);
                return None;
            };
            state.now_ns = event_ns.max(state.now_ns);
            state.reports.watch.instant(state.now_ns);
        }
    }

    fn carry_out(&self, state: &mut State<B, W>, here: CoreId) -> Option<Assignment> {
        let mut own = None;
        for index in 0..state.decisions.len() {
            let decision = state.decisions[index];
            let assignment = state.assign(decision.instance(), decision.core());
            if decision.core() == here {
                own = Some(assignment);
            } else {
                self.mailboxes[decision.core().index()].assign(assignment);
            }
        }
        own
    }

    #[inline]
    fn try_lock(&self) -> Option<MutexGuard<'_, State<B, W>>> {
        match self.state.0.try_lock() {
            Ok(guard) => Some(guard),
            // The worker that panicked in there has set `is_over`; the run ends with its panic.
            Err(TryLockError::Poisoned(poisoned)) => Some(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        }
    }
}

impl<B, W: Watch> State<B, W> {
    #[inline]
    fn assign(&mut self, instance: Instance, core: CoreId) -> Assignment {
        self.busy += 1;
        self.reports.watch.started(instance, core);
        Assignment {
            vertex: self.scheduler.vertex(instance),
            job: instance.job,
        }
    }
}

/// What a worker knows.
struct Me {
    core: CoreId,
    /// The turn of its post, if it may be that nobody has taken note of that.
    posted: Option<u32>,
    /// The turn of the latest assignment that it has seen.
    assigned: u32,
}

/// An instance that a worker runs.
struct Running<'a, B> {
    vertex: Vertex,
    job: u64,
    body: MutexGuard<'a, B>,
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
