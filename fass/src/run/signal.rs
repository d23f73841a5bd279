//! Where a signal goes, and how a subtask's completion sends it there.

use alloc::sync::Arc;
use core::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

use sched_dag::DagId;
use sched_dag::lifecycle::Request;

use super::effect::Effect;

/// Which DAG is meant, by a signal that releases it or a switch: known from the commit on.
#[derive(Debug, Default)]
pub(crate) struct Target {
    /// The plan's number, 0 before the commit.
    plan: AtomicU64,
    dag: AtomicU32,
}

impl Target {
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

/// A signal that an instance may have raised.
pub(crate) struct Raised {
    raised: Arc<AtomicBool>,
    target: Arc<Target>,
}

impl Raised {
    pub(crate) fn new(raised: Arc<AtomicBool>, target: Arc<Target>) -> Self {
        Self { raised, target }
    }
}

impl Effect for Raised {
    fn happen(&mut self, _completed_ns: u64, ask: &mut dyn FnMut(Request)) {
        if self.raised.load(Ordering::Relaxed) {
            self.raised.store(false, Ordering::Relaxed);
            ask(Request::Signal(self.target.dag()));
        }
    }
}
