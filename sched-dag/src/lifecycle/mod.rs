//! Requests of functions to the run as a whole, and how the run carries them out.
//!
//! Besides passing values, a function may ask for other effects: that a sporadic DAG gets a signal,
//! that a DAG pauses or resumes, that another set of DAGs runs (M1 to M7, in `modes`), or that the
//! run ends. Like every effect of a function, a *request* takes effect with the completion of its
//! instance (R3), never before. The scenarios of the rules, in `tests/scenarios/lifecycle.txt`,
//! bear their numbers:
//!
//! - **L1, when.** Within a cluster, a request takes effect at the instant of the completion, after
//!   all completions and faults of that instant and before its releases. A failing instance makes
//!   no requests.
//! - **L2, in which order.** Requests of one instant are served in the order of their completions.
//!   Requests of one instance are served in the order in which its subtask states what it uses,
//!   each once.
//! - **L3, pausing.** Pausing or resuming a DAG follows P1 to P5: jobs in flight go on, due jobs
//!   are skipped, the grid stays. A DAG may pause itself: the job in hand goes on.
//! - **L4, the beginning.** A DAG may be paused from time 0 on, before its first release.
//! - **L5, the end.** A shutdown closes every DAG without recorded inputs (C1 to C5), all DAGs of a
//!   cluster at one instant, so the run is over when nothing is in flight any more. Later pauses,
//!   resumptions and modes have no effect.
//! - **L6, replays.** The effect of a request on a DAG with recorded inputs is in the recording:
//!   the jobs that were skipped. In a replay requests do not touch such a DAG.
//!
//! Where clusters have no instant in common, requests cross them as [`Mailboxes`].
//!
//! A driver has [`PendingRequests`], which keeps requests from a completion to the scheduler's
//! step, and the plan's [`Lifecycle`], which serves the requests of functions except signals. The
//! lifecycle is behind a trait, so an image without such requests contains no code for them.

mod mailboxes;
mod modes;

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::fmt;

use crate::ids::{ClusterId, DagId, ModeId};
use crate::scheduler::Moment;
use modes::ModeTable;

pub use crate::request::{ModeEntry, Request, WaitId, WaitLimit};
pub use mailboxes::{Mailboxes, Parts, divide};

/// A change in a scheduler, made by a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LifecycleChange {
    /// A DAG is paused (P1 to P5).
    Pause(DagId),
    /// A DAG's pause ends.
    Resume(DagId),
    /// A DAG is closed (C1 to C5).
    Close(DagId),
    /// If the DAG has a job in flight, the changes after this one do not take effect: in the next
    /// step the driver asks for [`Request::GoOn`].
    Await(DagId),
    /// A mode is entered, and nothing waits for a mode any more.
    Enter(ModeId),
}

/// Serves pauses, resumptions, changes of mode and the end of the run: all requests of functions
/// except signals.
pub trait Lifecycle: fmt::Debug + Send {
    /// Turns a request into changes. There is [`room`](Self::room) for the changes.
    fn serve(&mut self, request: Request, changes: &mut Vec<LifecycleChange>);

    /// Leaves a DAG alone from now on (L6).
    fn leave_alone(&mut self, dag: DagId);

    /// Returns the DAGs of all modes.
    fn dags_of_modes(&self) -> Vec<DagId>;

    /// Returns the lifecycle of one cluster, before the run. The part serves requests about the
    /// cluster's DAGs; only one cluster keeps the modes.
    fn part(&self, is_here: &dyn Fn(DagId) -> bool, has_modes: bool) -> Box<dyn Lifecycle>;

    /// Reports whether a function may ask for the end of the run.
    fn may_shut_down(&self) -> bool;

    /// Returns the number of different requests possible, without signals, and the largest number
    /// of changes from one request.
    fn room(&self) -> (usize, usize);
}

/// The requests of a run on their way to the scheduler.
#[derive(Debug)]
pub struct PendingRequests {
    /// Each request once; there is room for all.
    kept: Vec<Request>,
    lifecycle: Option<Box<dyn Lifecycle>>,
    changes: Vec<LifecycleChange>,
}

impl PendingRequests {
    /// Allocates room for the requests of a plan of so many DAGs.
    pub fn new(dags: usize, lifecycle: Option<Box<dyn Lifecycle>>) -> Self {
        let room = lifecycle.as_ref().map(|lifecycle| lifecycle.room());
        let (others, changes) = room.unwrap_or_default();
        let mut kept = Vec::with_capacity(dags.saturating_add(others).saturating_add(1));
        // The first request: DAGs stated as paused are paused in the very first step, before any
        // release.
        kept.extend(lifecycle.as_ref().map(|_| Request::Begin));
        Self {
            kept,
            lifecycle,
            changes: Vec::with_capacity(changes),
        }
    }

    /// Keeps a request, mostly of a function, until the next step. A function's request never
    /// answers a wait: answers come only as letters.
    pub fn keep(&mut self, request: Request) {
        // Keeping a request once is enough. This bounds the room: one place for each different
        // request.
        if !self.kept.contains(&request) {
            self.kept.push(request);
        }
    }

    /// Reports whether no request is on its way: then a completion may be the whole step.
    #[inline]
    pub const fn are_none(&self) -> bool {
        self.kept.is_empty()
    }

    /// Gives away the requests accepted by `take`, namely those concerning other schedulers only.
    pub fn give_away(&mut self, mut take: impl FnMut(Request) -> bool) {
        self.kept.retain(|&request| !take(request));
    }

    /// Takes the letters from other clusters and from outside. A letter about a single DAG, without
    /// effect on the [`Lifecycle`], is passed on at once.
    #[inline(always)]
    pub fn take_letters(
        &mut self,
        letters: &Mailboxes,
        cluster: ClusterId,
        moment: &mut Moment<'_>,
    ) {
        letters.take_all(cluster, |request| {
            // The lifecycle has to know of a person's pause, for example; a signal concerns the
            // scheduler alone. Each letter finds the DAG as the letters before have left it.
            if self.lifecycle.is_some() && request.is_of_lifecycle() {
                self.keep(request);
                self.serve(moment);
            } else {
                moment.serve(request);
            }
        });
    }

    /// Passes the requests on to the scheduler, after the completions of the instant.
    pub fn serve(&mut self, moment: &mut Moment<'_>) {
        let mut waits = false;
        for request in self.kept.drain(..) {
            match &mut self.lifecycle {
                Some(lifecycle) if request.is_of_lifecycle() => {
                    lifecycle.serve(request, &mut self.changes);
                }
                _ => moment.serve(request),
            }
            for change in self.changes.drain(..) {
                match change {
                    LifecycleChange::Pause(dag) => moment.serve(Request::Pause(dag)),
                    LifecycleChange::Resume(dag) => moment.serve(Request::Resume(dag)),
                    LifecycleChange::Close(dag) => moment.serve(Request::Close(dag)),
                    LifecycleChange::Await(dag) if moment.in_flight(dag) == 0 => {}
                    LifecycleChange::Await(_) => {
                        // The changes behind it in the list must not happen before the DAG has
                        // ended its jobs.
                        waits = true;
                        break;
                    }
                    LifecycleChange::Enter(mode) => {
                        waits = false;
                        moment.entered(mode);
                    }
                }
            }
        }
        // Asked again in each step, until the DAGs waited for are idle.
        if waits {
            self.kept.push(Request::GoOn);
        }
    }
}

/// The lifecycle that an app states for its run, and the progress of the run in it.
#[derive(Clone, Debug, Default)]
pub struct LifecyclePlan {
    /// The DAGs of the plan open to requests.
    dags: Vec<DagId>,
    /// The DAGs paused from the beginning on.
    paused: Vec<DagId>,
    modes: ModeTable,
    may_shut_down: bool,
    /// The number of DAGs in the plan.
    count: usize,
}

impl LifecyclePlan {
    /// Makes the lifecycle for a plan of so many DAGs.
    pub fn new(dags: u32, may_shut_down: bool) -> Self {
        Self {
            dags: (0..dags).map(DagId).collect(),
            may_shut_down,
            count: dags as usize,
            ..Self::default()
        }
    }

    /// Lets DAGs be paused from the beginning on (L4).
    #[must_use]
    pub fn with_paused(self, paused: Vec<DagId>) -> Self {
        Self { paused, ..self }
    }

    /// States the DAGs of each mode, by their numbers; the run begins in the first one (M1).
    #[must_use]
    pub fn with_modes(self, modes: Vec<Vec<DagId>>) -> Self {
        Self {
            modes: ModeTable::new(modes),
            ..self
        }
    }

    fn touches(&self, dag: DagId) -> bool {
        self.dags.contains(&dag)
    }
}

impl Lifecycle for LifecyclePlan {
    fn serve(&mut self, request: Request, changes: &mut Vec<LifecycleChange>) {
        match request {
            Request::Begin => {
                changes.extend(self.paused.drain(..).map(LifecycleChange::Pause));
                self.modes.ask(ModeId(0), ModeEntry::AtOnce, changes);
            }
            Request::GoOn => self.modes.go_on(changes),
            Request::Enter(mode, entry) => self.modes.ask(mode, entry, changes),
            Request::Pause(dag) if self.touches(dag) => changes.push(LifecycleChange::Pause(dag)),
            Request::Resume(dag) if self.touches(dag) => changes.push(LifecycleChange::Resume(dag)),
            Request::ShutDown => {
                // From now on no mode resumes a closed DAG.
                self.modes = ModeTable::default();
                // Drained: later requests touch none of them.
                changes.extend(self.dags.drain(..).map(LifecycleChange::Close));
            }
            // Requests about one DAG without effect on the plan: `touches` was false, or the
            // scheduler serves them. `Step` asks for nothing but a step.
            Request::Pause(_)
            | Request::Resume(_)
            | Request::Signal(_)
            | Request::Close(_)
            | Request::End(_)
            | Request::Answer(_)
            | Request::Step => {}
        }
    }

    fn leave_alone(&mut self, dag: DagId) {
        self.dags.retain(|&other| other != dag);
        self.paused.retain(|&other| other != dag);
        self.modes.leave_alone(dag);
    }

    fn dags_of_modes(&self) -> Vec<DagId> {
        self.modes.dags().collect()
    }

    fn part(&self, is_here: &dyn Fn(DagId) -> bool, has_modes: bool) -> Box<dyn Lifecycle> {
        let here = |dags: &[DagId]| dags.iter().copied().filter(|dag| is_here(*dag)).collect();
        Box::new(Self {
            dags: here(&self.dags),
            paused: here(&self.paused),
            modes: match has_modes {
                true => self.modes.clone(),
                false => ModeTable::default(),
            },
            ..*self
        })
    }

    fn may_shut_down(&self) -> bool {
        self.may_shut_down
    }

    fn room(&self) -> (usize, usize) {
        // A pause and a resumption of each DAG, both ways into each mode, and three single
        // requests: the beginning, going on, the end.
        let kinds = 2 * self.count + 2 * self.modes.count() + 3;
        // At the beginning: the paused DAGs, the changes of the first mode, and its entry. A mode
        // pauses DAGs, awaits them, resumes others, and is entered.
        (kinds, 2 * self.count + 1)
    }
}
