//! Offering an app's parameters to people.

use fass::Tunable;

use super::machine_handle::Machine;
use front::app::ending::Ending;
use front::app::offered::Parameters;

impl Machine {
    /// Lets people set parameters before the run by the word `set=NAME=VALUE,...`, which
    /// `./scripts/run --set` and `--params` make. To be called before
    /// [`Options::finish`](crate::options::Options::finish), which otherwise refuses that word.
    ///
    /// # Errors
    ///
    /// [`Ending::Usage`] in one line, if the word names no parameter, or no value of its type and
    /// range; [`Ending::Failure`] if two have one name.
    pub fn offer(&self, parameters: &[&dyn Tunable]) -> Result<(), Ending> {
        let offered = Parameters::new(parameters).map_err(Ending::Failure)?;
        if let Some(word) = self.options.text("set") {
            offered.set_all(word)?;
        }
        Ok(())
    }
}
