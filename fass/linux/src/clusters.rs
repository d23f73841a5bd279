//! How the cores of a machine are divided.

use fass::{Clusters, Platform as _};

use crate::machine::Linux;
use crate::platform::HOST;

impl Linux {
    /// Divides the cores into clusters of so many each, from core 0 on; no number: they are not
    /// divided. Each cluster schedules its own DAGs, under a lock of its own and with a release
    /// thread of its own. See [`fass::Dag::cluster`].
    ///
    /// ```
    /// use std::time::Duration;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// use linux::{Linux, Mechanism};
    ///
    /// let machine = Linux::sharing(2, Mechanism::Normal).unwrap().clusters(&[1, 1]);
    /// let dags = [0, 1].map(|cluster| {
    ///     let (dag, period) = (create_dag(), Duration::from_millis(2));
    ///     dag.cluster(cluster).jobs(3).period(period).relative_deadline(period);
    ///     dag.register_untyped_subtask(|_job| (), SubtaskAttributes::named("tick"));
    ///     dag
    /// });
    /// finish_create_dags(&dags).unwrap();
    /// let run = machine.run().unwrap();
    /// assert!(run.journal().events().all(|event| event.core.0 == event.dag.0));
    /// ```
    #[must_use = "the machine itself is returned"]
    pub fn clusters(self, sizes: &[u32]) -> Self {
        self.divide(sizes);
        self
    }

    /// Lets the commit divide the cores: a DAG that needs several gets a cluster of its own, the
    /// others share clusters of one core each. All subtasks need WCETs. See [`fass::Placement`].
    #[must_use = "the machine itself is returned"]
    pub fn assign_clusters(self) -> Self {
        self.divide_by_commit();
        self
    }

    /// Divides the cores in the commits to come, as [`clusters`](Self::clusters) does.
    pub fn divide(&self, sizes: &[u32]) {
        let clusters = match sizes {
            [] => Clusters::Undivided,
            sizes => Clusters::Of(sizes.to_vec()),
        };
        HOST.divide(clusters, false);
    }

    /// Leaves that to the commits to come, as [`assign_clusters`](Self::assign_clusters) does.
    pub fn divide_by_commit(&self) {
        HOST.divide(Clusters::Undivided, true);
    }

    /// Returns how the cores are divided in the commits to come, unless these are to find that.
    #[must_use]
    pub fn division(&self) -> Clusters {
        HOST.clusters()
    }
}
