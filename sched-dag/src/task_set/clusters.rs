//! The clusters of a task set: which cores they have, and which DAGs.

use alloc::vec::Vec;
use core::ops::Range;

use super::{Dag, TaskSet};
use crate::clusters::Why;
use crate::ids::ClusterId;

impl TaskSet {
    /// Divides the cores, and puts each DAG into a cluster for a reason.
    pub(crate) fn divide(&mut self, sizes: &[u32], of_dags: &[(ClusterId, Why)]) {
        self.clusters = sizes.into();
        for (dag, (cluster, why)) in self.dags.iter_mut().zip(of_dags) {
            (dag.cluster, dag.why_there) = (Some(*cluster), Some(*why));
        }
    }

    /// Reports whether the cores are divided into clusters.
    #[must_use]
    pub const fn is_divided(&self) -> bool {
        !self.clusters.is_empty()
    }

    /// Returns the clusters; if the cores are not divided, the one of all cores.
    pub fn clusters(&self) -> impl Iterator<Item = ClusterId> + use<> {
        (0..).map(ClusterId).take(self.clusters.len().max(1))
    }

    /// Returns the cores of a cluster, on a machine of `all`.
    ///
    /// # Panics
    ///
    /// If there is no such cluster.
    #[must_use]
    #[inline(never)]
    pub fn cores_of(&self, cluster: ClusterId, all: u32) -> Range<u32> {
        if !self.is_divided() {
            return 0..all;
        }
        let (before, from_it_on) = self.clusters.split_at(cluster.index());
        let first = before.iter().sum();
        first..first + from_it_on[0]
    }

    /// Returns copies of the DAGs of a cluster.
    pub(crate) fn part(&self, cluster: ClusterId) -> Vec<Dag> {
        let dags = self.dags.iter();
        dags.filter(|dag| dag.cluster() == cluster)
            .cloned()
            .collect()
    }
}

impl Dag {
    /// Returns the cluster whose cores run it; if the cores are not divided, cluster 0.
    #[must_use]
    pub fn cluster(&self) -> ClusterId {
        self.cluster.unwrap_or_default()
    }

    /// Returns why the commit has chosen that; `None` if it has not.
    #[must_use]
    pub const fn why_there(&self) -> Option<Why> {
        self.why_there
    }

    /// Reports whether a cluster is stated, or chosen.
    #[must_use]
    pub const fn states_cluster(&self) -> bool {
        self.cluster.is_some()
    }
}
