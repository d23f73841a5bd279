//! Where a signal goes.

use core::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use sched_dag::DagId;

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
