//! DAGs that are added to a run in virtual time, and closed.

use alloc::sync::Arc;

use super::{VirtualTime, Workload, at};
use crate::ids::DagId;
use crate::task_set::TaskSet;

impl VirtualTime {
    /// Goes on with more DAGs: the same, and others behind them, for which memory is taken here.
    ///
    /// # Panics
    ///
    /// If there are fewer DAGs or clusters than before.
    pub fn extend(&mut self, task_set: &Arc<TaskSet>) {
        let known = self.clusters[0].scheduler.task_set().dags().len();
        for (cluster, of_cluster) in task_set.clusters().zip(&mut self.clusters) {
            of_cluster.extend(cluster, task_set);
        }
        if let Some(lifecycle) = &mut self.lifecycle {
            task_set
                .ids()
                .skip(known)
                .for_each(|dag| lifecycle.add(dag));
        }
    }

    /// Closes a DAG at a time between two events (C1 to C5).
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    pub fn close(&mut self, dag: DagId, now_ns: u64, workload: &mut impl Workload) {
        workload.instant(now_ns);
        at(&mut self.clusters, now_ns, dag).close(dag, workload);
    }
}
