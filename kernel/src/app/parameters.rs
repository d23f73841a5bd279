//! Offering an app's parameters to people.

use alloc::boxed::Box;
use alloc::format;
use alloc::string::ToString;

use fass::Tunable;

use super::ending::Ending;
use super::machine_handle::Machine;
use crate::watch::background::more::PARAMETERS;
use crate::watch::background::parameters::Parameters;
use executive::text::options::UsageError;

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
        let mut names = (1..).zip(parameters);
        if let Some((_, twice)) = names.find(|(next, parameter)| {
            let rest = parameters.get(*next..).unwrap_or_default();
            rest.iter().any(|other| other.name() == parameter.name())
        }) {
            let name = twice.name();
            let line = format!("two parameters have the name `{name}`; give each its own");
            return Err(Ending::Failure(line));
        }
        let shared = parameters.iter().map(|parameter| parameter.share());
        let shared = Parameters(shared.collect());
        if let Some(word) = self.options.text("set") {
            for part in word.split(',') {
                let mut refusal = None;
                match part.split_once('=') {
                    Some((name, value)) => {
                        shared.set(name, value, &mut |why| refusal = Some(why.to_string()));
                    }
                    None => refusal = Some(format!("`set={part}`: give it as NAME=VALUE")),
                }
                if let Some(line) = refusal {
                    return Err(UsageError::new(line).into());
                }
            }
        }
        let offered = PARAMETERS.set(Box::leak(Box::new(shared)));
        let twice = |_| Ending::Failure("parameters are offered twice; offer all at once".into());
        offered.map(drop).map_err(twice)
    }
}
