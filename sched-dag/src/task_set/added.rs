//! Task sets that grow: DAGs that come later, and what is left when some have gone.

use alloc::boxed::Box;

use super::{Dag, TaskSet};
use crate::clusters::Clusters;
use crate::ids::{DagId, to_u32};
use crate::policy::Priority;

impl TaskSet {
    /// Returns these DAGs, and behind them those of another commit, whose time begins at
    /// `from_ns`: their offsets are that much larger (A2).
    #[must_use]
    pub fn with_added(&self, added: &Self, from_ns: u64) -> Self {
        let later = added.dags.iter().map(|dag| Dag {
            offset_ns: dag.offset_ns.saturating_add(from_ns),
            ..dag.clone()
        });
        let dags: Box<[Dag]> = self.dags.iter().cloned().chain(later).collect();
        Self::new(dags, &self.clusters)
    }

    /// Returns these DAGs without some, which then have other numbers.
    #[must_use]
    pub fn only(&self, is_left: impl Fn(DagId) -> bool) -> Self {
        let dags = (0..).map(DagId).zip(&self.dags);
        let left = dags.filter(|(id, _)| is_left(*id));
        Self::new(left.map(|(_, dag)| dag.clone()).collect(), &self.clusters)
    }

    /// Returns how its cores are divided, for a commit of DAGs that are added.
    #[must_use]
    pub fn division(&self) -> Clusters {
        if self.is_divided() {
            Clusters::Of(self.clusters.to_vec())
        } else {
            Clusters::Undivided
        }
    }

    /// Returns the priority after which those of DAGs that are added and state none begin.
    #[must_use]
    pub fn last_priority(&self) -> Option<Priority> {
        let subtasks = self.dags.iter().flat_map(|dag| &dag.subtasks);
        subtasks
            .map(|subtask| subtask.priority)
            .max_by_key(|Priority(number)| *number)
    }

    /// Returns the numbers of its DAGs.
    pub fn ids(&self) -> impl Iterator<Item = DagId> + Clone + use<> {
        (0..to_u32(self.dags.len())).map(DagId)
    }
}
