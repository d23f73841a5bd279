//! What runs the instances of one subtask on this machine.

use alloc::vec::Vec;
use core::ops::{Deref, DerefMut};

use fass::Body;
use sched_dag::TaskSet;

use super::cluster::{self, Cluster};

/// A subtask's [runner](fass::Runner), and what running an instance of it takes here.
///
/// There is one for each subtask, as a subtask has one started instance at a time
/// (R2). Between its place and the core that runs it moves a [`Loan`](super::Loan).
pub struct Runner {
    pub(super) inner: fass::Runner,
    cluster: &'static Cluster,
    /// The time that an instance may execute for, `u64::MAX` if there is no limit.
    pub(super) budget_ns: u64,
}

impl Runner {
    /// Returns the cluster that runs it.
    #[inline]
    pub(super) const fn cluster(&self) -> &'static Cluster {
        match cluster::MAY_DIVIDE {
            true => self.cluster,
            false => &cluster::FIRST,
        }
    }
}

impl Deref for Runner {
    type Target = fass::Runner;

    #[inline]
    fn deref(&self) -> &fass::Runner {
        &self.inner
    }
}

impl DerefMut for Runner {
    #[inline]
    fn deref_mut(&mut self) -> &mut fass::Runner {
        &mut self.inner
    }
}

/// Makes a runner for each body, by vertex.
pub(super) fn runners(
    task_set: &TaskSet,
    bodies: Vec<Vec<Body>>,
    budget_factor: u64,
) -> impl Iterator<Item = Runner> {
    fass::Runner::all(task_set, bodies).map(move |inner| {
        let dag = task_set.dag(inner.instance.dag);
        let subtask = dag.subtask(inner.instance.subtask);
        Runner {
            cluster: cluster::nth(dag.cluster().index()),
            budget_ns: subtask.most_execution_ns(budget_factor),
            inner,
        }
    })
}
