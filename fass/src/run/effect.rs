//! Effects of an instance outside its DAG, held back until it is complete.
//!
//! Values on edges need no holding back: their readers are started by the
//! scheduler, and only after the completion. Latest values, signals and requests to the
//! run as a whole have readers that do not wait for it. So the function only *prepares*
//! them, and the platform publishes them when it reports the completion
//! ([`SubtaskCode::complete`](crate::platform::SubtaskCode::complete)): the completion boundary (R3) holds
//! for them as it does for edges, also in virtual time, where a function has run
//! long before its instance is complete.

use alloc::boxed::Box;
use alloc::sync::Arc;
use core::sync::atomic::{AtomicU8, AtomicU32, AtomicU64, Ordering};

use sched_dag::lifecycle::{ModeEntry, Request};
use sched_dag::{DagId, ModeId};

/// Something that a function has prepared, perhaps.
pub(crate) trait Effect: Send {
    /// Publishes it if it was prepared since the last time. `ask` takes what the scheduler is
    /// to be told.
    fn happen(&mut self, completed_ns: u64, ask: &mut dyn FnMut(Request));

    /// Does what is to be done at the end of a turn that ends in a wait, of so many nanoseconds at
    /// the most. Reports whether it waits for something that is there.
    fn wait(&mut self, _ended_and_limit_ns: (u64, u64), _ask: &mut dyn FnMut(Request)) -> bool {
        false
    }

    /// Takes note of the turns of its subtask, by their address, if that may wait.
    fn bind(&mut self, _turn: usize) {}

    /// Returns the word that the latest wait has changed, if a thread of the platform may sleep on
    /// it: once.
    fn bell(&mut self) -> Option<Arc<AtomicU32>> {
        None
    }

    /// Takes back what the latest wait has posted: its instance is cancelled.
    fn withdraw(&mut self) {}

    /// Does what is to be done for an instance that has failed.
    fn fail(&mut self, _failed_ns: u64) {}

    /// Keeps its signals from going anywhere.
    fn mute(&mut self) {}
}

/// The effect that a platform adds to a completion.
impl Effect for Box<dyn FnMut() + Send> {
    fn happen(&mut self, _completed_ns: u64, _ask: &mut dyn FnMut(Request)) {
        self();
    }

    fn wait(&mut self, _ended_and_limit_ns: (u64, u64), _ask: &mut dyn FnMut(Request)) -> bool {
        self();
        false
    }
}

/// Which DAG is meant, by a signal that releases it or a switch: known from the commit on.
#[derive(Debug, Default)]
pub(crate) struct RequestTarget {
    /// The plan's number, 0 before the commit.
    plan: AtomicU64,
    dag: AtomicU32,
}

impl RequestTarget {
    /// Returns the plan's number and the DAG, once there are any.
    pub(crate) fn get(&self) -> Option<(u64, DagId)> {
        let plan = self.plan.load(Ordering::Acquire);
        (plan > 0).then(|| (plan, self.dag()))
    }

    /// Returns the DAG; to be called behind the commit.
    pub(crate) fn dag(&self) -> DagId {
        DagId(self.dag.load(Ordering::Relaxed))
    }

    /// Tells the signal its DAG.
    pub(crate) fn set(&self, plan: u64, dag: DagId) {
        self.dag.store(dag.0, Ordering::Relaxed);
        self.plan.store(plan, Ordering::Release);
    }
}

/// No wish.
const NOTHING: u8 = 0;
/// The wish that a DAG is paused, or that the run ends.
pub(crate) const STOP: u8 = 1;
/// The wish that a DAG is resumed, or released by its signal.
pub(crate) const GO: u8 = 2;
/// The wish that a mode is entered at once.
pub(crate) const AT_ONCE: u8 = 1;
/// The wish that a mode is entered when what leaves is idle.
pub(crate) const WHEN_IDLE: u8 = 2;

/// A place for what an instance wishes, at first nothing; the last word counts.
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
            // A place that no function knows.
            self.wish = Wish::default();
        }
    }
}
