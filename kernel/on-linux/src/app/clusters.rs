//! How an app divides the cores of Linux, or leaves that to the command line.

use fass::Clusters;

use super::machine_handle::Machine;
use crate::options::UsageError;
use front::app::division;

impl Machine {
    /// Divides the cores into clusters of so many each in the commits to come; no number: they
    /// are not divided.
    pub fn divide(&self, sizes: &[u32]) {
        self.linux().divide(sizes);
    }

    /// Leaves that to the command line's word `clusters`: numbers of cores, or `auto` for the
    /// commit's own division.
    ///
    /// # Errors
    ///
    /// If the word is neither.
    pub fn offer_clusters(&self) -> Result<(), UsageError> {
        match division::read(self.options())? {
            Some(sizes) => self.linux().divide(&sizes),
            None => self.linux().divide_by_commit(),
        }
        Ok(())
    }

    /// Returns how the cores are divided, unless the commit is to find that.
    #[must_use]
    pub fn clusters(&self) -> Clusters {
        self.linux().division()
    }
}
