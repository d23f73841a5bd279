//! How an app divides the cores, or leaves that to the command line.

use alloc::vec::Vec;

use fass::{Clusters, Dag, Terms};

use super::machine::{Machine, System};
use crate::options::UsageError;

/// A system whose cores can be divided. The kernel is one with its feature `clusters`: without
/// that an image has none of the code that divided cores need, and pays nothing for them.
///
/// See [`Machine`].
pub trait Divisible: System {}

impl<S: Divisible> Machine<S> {
    /// Divides the cores, from core 0 on, into clusters of so many each in the commits to come;
    /// no number: they are not divided. Each cluster schedules its own DAGs
    /// ([`fass::Dag::cluster`]).
    ///
    /// ```no_run
    /// fn keep_brakes_apart(machine: &kernel::Machine) {
    ///     let others = machine.cores() - 1;
    ///     machine.divide(&[1, others]); // cluster 0 is core 0
    /// }
    /// ```
    pub fn divide(&self, sizes: &[u32]) {
        self.system.change(|terms| terms.divide(sizes));
    }

    /// Leaves that to the command line's word `clusters`: `clusters=2,2` divides the cores so;
    /// with `clusters=auto` the commit does ([`sched_dag::analysis::assign()`]): a DAG that
    /// needs several cores gets a cluster of its own, the others share clusters of one core each.
    /// For that all subtasks need WCETs, and no DAG states a cluster. Without the word cores are
    /// not divided.
    ///
    /// # Errors
    ///
    /// If the word is neither `auto` nor numbers of cores.
    ///
    /// ```no_run
    /// fn take_part(machine: &kernel::Machine) -> Result<(), kernel::Ending> {
    ///     machine.offer_clusters()?;
    ///     // build and commit DAGs
    ///     machine.run().map(drop)
    /// }
    /// ```
    pub fn offer_clusters(&self) -> Result<(), UsageError> {
        if self.options.text("clusters") == Some("auto") {
            self.system.change(Terms::divide_by_commit);
            return Ok(());
        }
        let sizes = self
            .options
            .numbers("clusters", 0..=u64::from(u32::MAX), &[])?;
        let sizes = sizes.into_iter().map(u32::try_from);
        let sizes: Vec<u32> = sizes.filter_map(Result::ok).collect();
        self.divide(&sizes);
        Ok(())
    }

    /// Gives each of these DAGs to one of the clusters that there are, in turn.
    ///
    /// ```no_run
    /// fn take_part(machine: &kernel::Machine, dags: &[fass::Dag]) -> Result<(), kernel::Ending> {
    ///     machine.offer_clusters()?;
    ///     machine.spread(dags);
    ///     fass::finish_create_dags(dags)?;
    ///     machine.run().map(drop)
    /// }
    /// ```
    pub fn spread(&self, dags: &[Dag]) {
        let clusters = (0..).take(self.clusters().sizes().len());
        for (cluster, dag) in clusters.cycle().zip(dags) {
            dag.cluster(cluster);
        }
    }

    /// Returns how the cores are divided, unless the commit is to find that.
    ///
    /// ```no_run
    /// fn are_divided(machine: &kernel::Machine) -> bool {
    ///     !machine.clusters().sizes().is_empty()
    /// }
    /// ```
    #[must_use]
    pub fn clusters(&self) -> Clusters {
        self.system.terms().clusters
    }
}
