//! Clusters, which Linux does not have: its cores are one.

use fass::Clusters;

use super::machine_handle::Machine;
use crate::options::UsageError;

impl Machine {
    /// Divides nothing: a commit refuses a DAG in another cluster than 0.
    pub const fn divide(&self, _sizes: &[u32]) {}

    /// Refuses the word `clusters`.
    ///
    /// # Errors
    ///
    /// If the word is given.
    pub fn offer_clusters(&self) -> Result<(), UsageError> {
        self.options().text("clusters").map_or(Ok(()), |_| {
            Err(UsageError::new(
                "`clusters`: the cores of Linux are not divided; leave it out, or run the app on \
                 the machine",
            ))
        })
    }

    /// Returns that they are not divided.
    #[must_use]
    pub const fn clusters(&self) -> Clusters {
        Clusters::Undivided
    }
}
