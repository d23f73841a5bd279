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
//! across cores costs little more than one transfer.
//!
//! # Keeping the lock
//!
//! A worker that leaves with the only instance that runs keeps the lock, too: nobody else
//! has an end to report, and no other cluster may knock. So a chain, or the way from a sink over the next release to its
//! fork, takes no lock and posts nothing.
//!
//! # Taking along
//!
//! A worker that leaves with something to run while others do run first takes what
//! they have posted meanwhile, and gives each of them what its end gives it. So a worker that
//! finds the lock taken waits for its mailbox, and tries the lock again only once in a while:
//! each try takes the lock's line from its owner.
//!
//! A post is taken exactly once, by the owner of the lock: another worker, or
//! the one that has posted, which tries the lock as long as nobody serves.
//!
//! # The order of a server's last steps
//!
//! It has seen a post, and has something to run. An atomic exchange has to wait until
//! all stores before it have arrived, also those to lines that another processor reads
//! right now. So the exchanges come first (the body's lock, the scheduler's), and then
//! the stores that others wait for: they leave while the body runs.

mod step;

use std::marker::PhantomData;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

use sched_dag::{CoreId, Scheduler, Vertex};

use crate::execute::{Execute, keep_signal};
use crate::mailbox::{Assignment, End, Mailbox};
use crate::others::Others;
use crate::relax::poll;
use crate::reports::{Line, Reports, Shared};
use crate::watch::Watch;

use step::State;

/// What all workers share.
pub(crate) struct Team<B, W, O> {
    state: Pair<Mutex<State<B, W>>>,
    bodies: Shared<B>,
    mailboxes: Box<[Mailbox]>,
    /// Whether the lock's owner looks into mailboxes, or keeps the lock since they are empty.
    is_serving: Pair<AtomicBool>,
    /// Set at the end, or by a worker that panics.
    is_over: Pair<AtomicBool>,
    others: O,
}

/// Rounds of polling between two tries for the lock.
const PAUSE: u32 = 32;

/// A value in two cache lines of its own, since processors fetch them in pairs.
#[repr(align(128))]
struct Pair<T>(T);

impl<B: Execute, W: Watch, O: Others> Team<B, W, O> {
    pub(crate) fn new(mut scheduler: Scheduler, bodies: Vec<B>, others: O) -> Self {
        let cores = scheduler.options().cores as usize;
        let dags = scheduler.task_set().dags().len();
        let bodies = bodies.into_iter().map(|body| Line(Mutex::new(body)));
        let bodies: Shared<B> = bodies.collect();
        Self {
            mailboxes: (0..cores).map(|_| Mailbox::new(dags)).collect(),
            state: Pair(Mutex::new(State {
                reports: Reports::new(&mut scheduler, Arc::clone(&bodies)),
                watch: PhantomData,
                scheduler,
                now_ns: 0,
                busy: 0,
                noted: vec![0; cores].into_boxed_slice(),
                is_attended: false,
                decisions: Vec::with_capacity(2 * cores),
            })),
            bodies,
            is_serving: Pair(AtomicBool::new(false)),
            is_over: Pair(AtomicBool::new(false)),
            others,
        }
    }

    /// Returns the scheduler and its observer, after all workers have returned.
    pub(crate) fn into_parts(self) -> Scheduler {
        let state = self.state.0.into_inner();
        let state = state.unwrap_or_else(PoisonError::into_inner);
        state.scheduler
    }

    /// Works until all jobs have ended. Worker 0 begins.
    pub(crate) fn work(&self, core: CoreId) {
        let _over = OverOnPanic(&self.is_over.0);
        let mailbox = &self.mailboxes[core.index()];
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
            // Another one may have begun, because of a letter: then this one has nothing to keep.
            next = own.map(|assignment| self.begin(assignment));
        }
        while let Some(mut running) = next.take().or_else(|| self.wait(&mut me)) {
            running.body.run(running.job);
            let mut has_signals = false;
            running.body.complete(&mut |dag| {
                has_signals = true;
                keep_signal(&mut mailbox.signals(), dag);
            });
            drop(running.body);
            match running.kept {
                Some(mut state) => {
                    let end = End {
                        vertex: running.vertex,
                        has_signals,
                    };
                    let own = self.finish(&mut state, core, core, end);
                    next = self.leave(state, core, own);
                }
                None => me.posted = Some(mailbox.post(running.vertex, has_signals)),
            }
        }
    }

    /// Takes what an assignment needs.
    #[inline]
    fn begin(&self, assignment: Assignment) -> Running<'_, B, W> {
        let Assignment { vertex, job } = assignment;
        let body = self.bodies[vertex.index()].0.lock();
        Running {
            vertex,
            job,
            body: body.unwrap_or_else(PoisonError::into_inner),
            kept: None,
        }
    }

    /// Waits for the next instance of this worker, and sees to it that its post is
    /// taken note of; `None` at the end.
    #[inline]
    fn wait(&self, me: &mut Me) -> Option<Running<'_, B, W>> {
        let mailbox = &self.mailboxes[me.core.index()];
        let mut pause = 0;
        poll(|| {
            if let Some(turn) = me.posted
                && !self.is_serving.0.load(Ordering::Relaxed)
            {
                if mailbox.is_hinted(turn) {
                    me.posted = None;
                } else if pause > 0 {
                    pause -= 1;
                } else if let Some(state) = self.try_lock() {
                    me.posted = None;
                    if let Some(own) = self.step(state, me.core, turn) {
                        return Some(Some(own));
                    }
                } else {
                    pause = PAUSE;
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

    /// Takes the worker's own post, if nobody has done so meanwhile, and those that others
    /// have left. Returns what it runs next.
    #[inline]
    fn step<'a>(
        &'a self,
        mut state: MutexGuard<'a, State<B, W>>,
        core: CoreId,
        turn: u32,
    ) -> Option<Running<'a, B, W>> {
        if state.noted[core.index()] == turn {
            return None;
        }
        state.noted[core.index()] = turn;
        let end = self.mailboxes[core.index()].posted().end;
        let own = self.finish(&mut state, core, core, end);
        if own.is_some() {
            self.collect(&mut state, core);
        }
        self.leave(state, core, own)
    }

    /// Takes the posts of others for a worker that has something to run: each gets what its
    /// own end gives it.
    #[inline]
    fn collect(&self, state: &mut State<B, W>, here: CoreId) {
        for (other, mailbox) in (0..).map(CoreId).zip(&self.mailboxes) {
            let post = mailbox.posted();
            if other != here && post.turn != state.noted[other.index()] {
                state.noted[other.index()] = post.turn;
                let own = self.finish(state, here, other, post.end);
                debug_assert!(own.is_none(), "{here:?} has something to run");
                mailbox.hint(post.turn);
            }
        }
    }

    /// Serves if the worker has got nothing to run but others do; then gives the lock back, or
    /// keeps it if nobody else could want it. Returns what the worker runs next.
    #[inline(always)]
    fn leave<'a>(
        &'a self,
        mut state: MutexGuard<'a, State<B, W>>,
        core: CoreId,
        own: Option<Assignment>,
    ) -> Option<Running<'a, B, W>> {
        let (own, ended) = match own {
            Some(own) => (own, None),
            None if state.busy > 0 => self.serve(&mut state, core)?,
            None => return None,
        };
        let mut running = self.begin(own);
        if state.busy == 1 && !O::MAY_KNOCK {
            self.attend(&mut state);
            running.kept = Some(state);
            return Some(running);
        }
        let was_attended = std::mem::replace(&mut state.is_attended, false);
        drop(state);
        if let Some((mailbox, turn)) = ended {
            mailbox.hint(turn);
        }
        if was_attended {
            self.is_serving.0.store(false, Ordering::Relaxed);
        }
        Some(running)
    }

    /// Takes the others' posts until this worker has something to run, or
    /// nobody else has. Returns also the last post's owner and turn, if nothing is hinted of
    /// that yet.
    #[inline(always)]
    fn serve(
        &self,
        state: &mut State<B, W>,
        core: CoreId,
    ) -> Option<(Assignment, Option<(&Mailbox, u32)>)> {
        self.attend(state);
        for other in (0..).map(CoreId).take(self.mailboxes.len()) {
            state.scheduler.anticipate(other);
        }
        poll(|| {
            for (other, mailbox) in (0..).map(CoreId).zip(&self.mailboxes) {
                let post = mailbox.posted();
                if post.turn == state.noted[other.index()] {
                    continue;
                }
                state.noted[other.index()] = post.turn;
                let own = self.take_note(state, core, other, core, post.end);
                if own.is_some() || state.busy == 0 {
                    return Some(own.map(|own| (own, Some((mailbox, post.turn)))));
                }
                mailbox.hint(post.turn);
            }
            if self.others.have_knocked()
                && let Some(own) = self.open(state, core)
            {
                return Some(Some((own, None)));
            }
            self.is_over.0.load(Ordering::Relaxed).then_some(None)
        })
    }

    /// Tells the others that the lock's owner looks after their posts.
    #[inline]
    fn attend(&self, state: &mut State<B, W>) {
        if !state.is_attended {
            state.is_attended = true;
            self.is_serving.0.store(true, Ordering::Relaxed);
        }
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

/// What a worker knows.
struct Me {
    core: CoreId,
    /// The turn of its post, if it may be that nobody has taken note of that.
    posted: Option<u32>,
    /// The turn of the latest assignment that it has seen.
    assigned: u32,
}

/// An instance that a worker runs.
struct Running<'a, B, W> {
    vertex: Vertex,
    job: u64,
    body: MutexGuard<'a, B>,
    /// The lock, if nothing else runs: then nobody else has an end to report.
    kept: Option<MutexGuard<'a, State<B, W>>>,
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
