//! What functions ask of a run as a whole, and how it comes about.
//!
//! A function may ask for more than values: that a sporadic DAG gets a signal, that a DAG rests
//! or goes on, that another set of DAGs runs (M1 to M7, in the module `modes`), that the run ends. As all that a function does, a *request* takes effect with
//! the completion of its instance (R3), never before. The rules, whose tests in `tests/lifecycle.rs`
//! bear their numbers:
//!
//! - **L1, when.** A request takes effect at the instant of the completion, after all completions
//!   and faults of that instant and before its releases. An instance that fails has asked for
//!   nothing.
//! - **L2, in which order.** Requests of one instant are served in the order of their
//!   completions, those of one instance in the order in which its subtask states what it uses, each
//!   once.
//! - **L3, pausing.** A DAG that is paused or resumed follows P1 to P5: what is in flight goes
//!   on, due jobs are skipped, the grid stays. A DAG may pause itself: the job in hand goes on.
//! - **L4, the beginning.** A DAG may be paused from time 0 on, before its first release.
//! - **L5, the end.** A shutdown closes every DAG (C1 to C5) at one instant, so the run is over
//!   when nothing is in flight any more. Of what is asked for later nothing comes.
//! - **L6, replays.** What came of a request to a DAG whose inputs are recorded is in the recording:
//!   the jobs that were skipped. In a replay requests do not touch such a DAG.
//!
//! Where clusters have no instant in common, requests cross them as [`Letters`].
//!
//! A driver has [`Requests`], which keeps them from a completion to the scheduler's step, and
//! the plan's [`Lifecycle`], which serves all but signals. It is behind a trait so that an
//! image none of whose functions asks for such a thing has no code for it.

mod changes;
mod letters;
mod modes;

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::fmt;

use crate::ids::{ClusterId, DagId, ModeId};
use crate::scheduler::Moment;
pub use changes::Changes;
pub use letters::{Letters, Parts, divide};

pub use crate::request::{Entry, Request};

/// What a request comes to, in a scheduler.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// A DAG is paused (P1 to P5).
    Pause(DagId),
    /// A DAG's pause ends.
    Resume(DagId),
    /// A DAG is closed (C1 to C5).
    Close(DagId),
    /// If the DAG has a job in flight, the changes that follow do not come about: in the next step
    /// the driver asks for [`Request::GoOn`].
    Await(DagId),
    /// A mode is entered, and nothing waits any more.
    Enter(ModeId),
}

/// Serves requests other than signals.
pub trait Lifecycle: fmt::Debug + Send {
    /// Says what a request comes to. There is [`room`](Self::room) for the changes.
    fn serve(&mut self, request: Request, changes: &mut Vec<Change>);

    /// Leaves a DAG alone from now on (L6).
    fn leave_alone(&mut self, dag: DagId);

    /// Returns the DAGs that are in some mode.
    fn dags_of_modes(&self) -> Vec<DagId>;

    /// Returns what serves the requests that concern the DAGs of one cluster, before the run; the
    /// modes are left to one cluster.
    fn part(&self, is_here: &dyn Fn(DagId) -> bool, has_modes: bool) -> Box<dyn Lifecycle>;

    /// Reports whether a function may ask for the end of the run.
    fn may_shut_down(&self) -> bool;

    /// Returns how many different requests there can be, signals not counted, and how many changes
    /// one comes to at most.
    fn room(&self) -> (usize, usize);
}

/// The requests of a run that are on their way to its scheduler.
#[derive(Debug)]
pub struct Requests {
    /// Each once; there is room for all.
    kept: Vec<Request>,
    lifecycle: Option<Box<dyn Lifecycle>>,
    changes: Vec<Change>,
}

impl Requests {
    /// Takes room for the requests of a plan of so many DAGs.
    #[must_use]
    pub fn new(dags: usize, lifecycle: Option<Box<dyn Lifecycle>>) -> Self {
        let room = lifecycle.as_ref().map(|lifecycle| lifecycle.room());
        let (others, changes) = room.unwrap_or_default();
        let mut kept = Vec::with_capacity(dags.saturating_add(others).saturating_add(1));
        kept.extend(lifecycle.as_ref().map(|_| Request::Begin));
        Self {
            kept,
            lifecycle,
            changes: Vec::with_capacity(changes),
        }
    }

    /// Keeps a request until the next step.
    pub fn keep(&mut self, request: Request) {
        if !self.kept.contains(&request) {
            self.kept.push(request);
        }
    }

    /// Reports whether none is on its way: then a completion may be all of a step.
    #[inline]
    #[must_use]
    pub const fn are_none(&self) -> bool {
        self.kept.is_empty()
    }

    /// Gives away the requests that `take` takes, which concern other schedulers only.
    pub fn give_away(&mut self, mut take: impl FnMut(Request) -> bool) {
        self.kept.retain(|&request| !take(request));
    }

    /// Takes what has come from other clusters and from outside. What concerns one DAG only, and
    /// no [`Lifecycle`], is passed on at once.
    #[inline(always)]
    pub fn take_letters(&mut self, letters: &Letters, cluster: ClusterId, moment: &mut Moment<'_>) {
        letters.take(cluster, |request| {
            if self.lifecycle.is_some() && request.is_of_lifecycle() {
                self.keep(request);
            } else {
                moment.serve(request);
            }
        });
    }

    /// Passes the requests on, after the completions of the instant.
    #[inline(always)]
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
                    Change::Pause(dag) => moment.serve(Request::Pause(dag)),
                    Change::Resume(dag) => moment.serve(Request::Resume(dag)),
                    Change::Close(dag) => moment.serve(Request::Close(dag)),
                    Change::Await(dag) if moment.in_flight(dag) == 0 => {}
                    Change::Await(_) => {
                        waits = true;
                        break;
                    }
                    Change::Enter(mode) => {
                        waits = false;
                        moment.entered(mode);
                    }
                }
            }
        }
        if waits {
            self.kept.push(Request::GoOn);
        }
    }
}
