//! How an app divides the machine's cores, or leaves that to the command line.
//!
//! An app that does so depends on the kernel with the feature `clusters`. Without that an image
//! has none of the code that divided cores need, and pays nothing for them.

use crate::options::UsageError;
use executive::run::execution::{Division, set_division};
use executive::run::platform::KERNEL;
use fass::{Clusters, Platform};

use super::machine_handle::Machine;
use front::app::division;

impl Machine {
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
        set_division(Division::Into(match sizes {
            [] => Clusters::Undivided,
            sizes => Clusters::Of(sizes.to_vec()),
        }));
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
        match division::read(self.options())? {
            Some(sizes) => self.divide(&sizes),
            None => set_division(Division::ByCommit),
        }
        Ok(())
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
        KERNEL.clusters()
    }
}
