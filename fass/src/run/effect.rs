//! Effects of an instance outside the DAG, held back until the instance is complete.
//!
//! Values on edges need no holding back: the scheduler starts their readers only after the
//! completion. The readers of latest values, signals and requests to the run as a whole do not wait
//! for the completion. So the function only *prepares* such effects. Questions to devices and bytes
//! on wires go out at the next wait; the platform publishes all others when reporting the
//! completion ([`SubtaskCode::complete`](crate::platform::SubtaskCode::complete)). The completion
//! boundary (R3) thus applies to effects as well as to edges, also in virtual time, where a
//! function has run long before the instance is complete.

use alloc::boxed::Box;
use alloc::sync::Arc;
use core::sync::atomic::{AtomicU8, AtomicU32, AtomicU64, Ordering};

use sched_dag::lifecycle::{ModeEntry, Request};
use sched_dag::{DagId, ModeId};

/// An action that a function may have prepared for the completion.
pub(crate) trait Effect: Send {
    /// Publishes the effect if the function has prepared one since the last call. `ask` takes
    /// requests to the scheduler.
    fn happen(&mut self, completed_ns: u64, ask: &mut dyn FnMut(Request));

    /// Acts at the end of a turn ending in a wait. The pair holds the end of the turn and the
    /// longest duration of the wait, in ns. Reports whether the awaited value is already there.
    fn wait(&mut self, _ended_and_limit_ns: (u64, u64), _ask: &mut dyn FnMut(Request)) -> bool {
        false
    }

    /// Stores the address of the subtask's [turns](super::turn), if the subtask may wait.
    fn bind(&mut self, _turn: usize) {}

    /// Returns the word changed by the latest wait, if a thread of the platform may sleep on the
    /// word. Returns it only once for each such wait.
    fn bell(&mut self) -> Option<Arc<AtomicU32>> {
        None
    }

    /// Withdraws the question posted by the latest wait, as the instance is cancelled.
    fn withdraw(&mut self) {}

    /// Acts for a failed instance.
    fn fail(&mut self, _failed_ns: u64) {}

    /// Discards the effect's signals from now on.
    fn mute(&mut self) {}
}

/// An effect added by a platform to each completion.
impl Effect for Box<dyn FnMut() + Send> {
    fn happen(&mut self, _completed_ns: u64, _ask: &mut dyn FnMut(Request)) {
        self();
    }

    fn wait(&mut self, _ended_and_limit_ns: (u64, u64), _ask: &mut dyn FnMut(Request)) -> bool {
        self();
        false
    }
}

/// The DAG meant by a signal or a switch, known from the commit on.
#[derive(Debug, Default)]
pub(crate) struct RequestTarget {
    /// The plan's number; 0 before the commit.
    plan: AtomicU64,
    dag: AtomicU32,
}

impl RequestTarget {
    /// Returns the plan's number and the DAG, or `None` before the commit.
    pub(crate) fn get(&self) -> Option<(u64, DagId)> {
        let plan = self.plan.load(Ordering::Acquire);
        (plan > 0).then(|| (plan, self.dag()))
    }

    /// Returns the DAG. To be called only after the commit.
    pub(crate) fn dag(&self) -> DagId {
        DagId(self.dag.load(Ordering::Relaxed))
    }

    /// Sets the plan's number and the DAG, at the commit.
    pub(crate) fn set(&self, plan: u64, dag: DagId) {
        // The plan last, by `Release`: a reader seeing the plan's number sees the DAG, too.
        self.dag.store(dag.0, Ordering::Relaxed);
        self.plan.store(plan, Ordering::Release);
    }
}

/// No request.
const NOTHING: u8 = 0;
/// The request to pause a DAG, or to end the run.
pub(crate) const STOP: u8 = 1;
/// The request to resume a DAG, or to release a DAG by a signal.
pub(crate) const GO: u8 = 2;
/// The request to enter a mode at once.
pub(crate) const AT_ONCE: u8 = 1;
/// The request to enter a mode once the DAGs it pauses are idle.
pub(crate) const WHEN_IDLE: u8 = 2;

/// A place for the request of an instance, initially empty; the last request counts.
pub(crate) type Wish = Arc<AtomicU8>;

/// The kind of a request.
pub(crate) enum RequestKind {
    Run,
    Signal(Arc<RequestTarget>),
    Dag(Arc<RequestTarget>),
    Mode(ModeId),
}

/// The requests that an instance may make.
pub(crate) struct InstanceRequests {
    pub(crate) wish: Wish,
    pub(crate) of: RequestKind,
}

impl Effect for InstanceRequests {
    fn happen(&mut self, _completed_ns: u64, ask: &mut dyn FnMut(Request)) {
        // Not an exchange: the function has returned, and nobody else changes the wish.
        let wish = self.wish.load(Ordering::Relaxed);
        if wish == NOTHING {
            return;
        }
        self.wish.store(NOTHING, Ordering::Relaxed);
        ask(match &self.of {
            RequestKind::Run => Request::ShutDown,
            RequestKind::Signal(target) => Request::Signal(target.dag()),
            RequestKind::Dag(target) if wish == STOP => Request::Pause(target.dag()),
            RequestKind::Dag(target) => Request::Resume(target.dag()),
            RequestKind::Mode(mode) if wish == AT_ONCE => Request::Enter(*mode, ModeEntry::AtOnce),
            RequestKind::Mode(mode) => Request::Enter(*mode, ModeEntry::WhenIdle),
        });
    }

    fn mute(&mut self) {
        if let RequestKind::Signal(_) = self.of {
            // A fresh place unknown to every function, so later requests have no effect.
            self.wish = Wish::default();
        }
    }
}
