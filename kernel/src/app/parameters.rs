//! Offering an app's parameters to people.

use alloc::boxed::Box;

use fass::Tunable;

use super::machine_handle::Machine;
use crate::watch::background::live_run::PARAMETERS;
use front::app::ending::Ending;
use front::app::offered::Parameters;

impl Machine {
    /// Lets people set parameters: at the console by `set NAME VALUE`, before the first run by the
    /// word `set=NAME=VALUE,...` of the command line, which `./scripts/run --set` and `--params`
    /// make. To be called before [`Options::finish`](crate::options::Options::finish), which
    /// otherwise refuses that word.
    ///
    /// # Errors
    ///
    /// [`Ending::Usage`] in one line, if the word names no parameter, or no value of its type and
    /// range; [`Ending::Failure`] if two have one name, or it was called before.
    ///
    /// ```no_run
    /// use fass::Parameter;
    ///
    /// fn gain(machine: &kernel::Machine) -> Result<Parameter<f64>, kernel::Ending> {
    ///     let gain = Parameter::new("gain", 0.5, 0.0..=2.0);
    ///     machine.offer(&[&gain])?;
    ///     machine.options().finish(&[])?;
    ///     Ok(gain)
    /// }
    /// ```
    pub fn offer(&self, parameters: &[&dyn Tunable]) -> Result<(), Ending> {
        let shared = Parameters::new(parameters).map_err(Ending::Failure)?;
        if let Some(word) = self.options.text("set") {
            shared.set_all(word)?;
        }
        let offered = PARAMETERS.set(Box::leak(Box::new(shared)));
        let twice = |_| Ending::Failure("parameters are offered twice; offer all at once".into());
        offered.map(drop).map_err(twice)
    }
}
