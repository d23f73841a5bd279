//! Connecting an app's wire.

use fass::Wire;

use super::ends::Ends;
use super::machine_handle::Machine;
use crate::options::UsageError;
use front::app::ending::Ending;

impl Machine {
    /// Connects a wire: what comes on standard input arrives in the next run, with the word
    /// `input=-`, and what is sent goes to the file that `output=` names. To be called before
    /// [`Options::finish`](crate::options::Options::finish). After each run a line says what the
    /// wire has counted.
    ///
    /// # Errors
    ///
    /// [`Ending::Usage`] if the words name no end, [`Ending::Failure`] if another wire has them.
    pub fn connect(&self, wire: &Wire) -> Result<(), Ending> {
        let input = self.options.text("input");
        let output = self.options.text("output");
        if input.is_some_and(|input| input != "-") {
            let line = "`input`: a script of times is for the machine; on Linux give `input=-`";
            return Err(UsageError::new(line).into());
        }
        if input.is_none() && output.is_none() {
            let line = "has no ends; give --input - or --output FILE";
            return Err(UsageError::new(format!("wire `{}` {line}", wire.name())).into());
        }
        let ends = Ends {
            wire: wire.clone(),
            is_live: input.is_some(),
            output,
        };
        match self.wire.replace(Some(ends)) {
            None => Ok(()),
            Some(_) => Err(Ending::Failure(format!(
                "wire `{}` finds its ends taken; connect one wire",
                wire.name()
            ))),
        }
    }
}
