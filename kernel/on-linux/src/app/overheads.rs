//! Overheads, which are not measured on Linux: it states no worst case for what it does itself.

use super::machine_handle::Machine;
use crate::options::UsageError;
use front::app::ending::Ending;

impl Machine {
    /// Refuses the words `overheads` and `overheads_margin`.
    ///
    /// # Errors
    ///
    /// If one of them is given.
    pub fn offer_overheads(&self) -> Result<(), Ending> {
        let words = ["overheads", "overheads_margin"];
        let given = words.map(|word| self.options().text(word).is_some());
        match given.contains(&true) {
            false => Ok(()),
            true => Err(UsageError::new(
                "`overheads`: what Linux costs is not measured; state it by `overheads_ns=`, or \
                 run the app on the machine",
            )
            .into()),
        }
    }
}
