//! The ends of an app's wire: files and streams of Linux.

use std::fs::File;
use std::io::{self, Read, Write};

use fass::Wire;
use linux::{Connection, Linux};

use crate::options::UsageError;
use front::app::ending::Ending;

/// The ends of an app's wire: where bytes come from, and where they go.
#[derive(Clone, Debug)]
pub(crate) struct Ends {
    pub(crate) wire: Wire,
    /// Whether bytes come on standard input.
    pub(crate) is_live: bool,
    /// The file that bytes go to.
    pub(crate) output: Option<&'static str>,
}

impl Ends {
    /// Connects them for a run that is committed.
    pub(crate) fn connect(&self, machine: &Linux) -> Result<Connection, Ending> {
        let input: Box<dyn Read + Send> = match self.is_live {
            true => Box::new(io::stdin()),
            false => Box::new(io::empty()),
        };
        let output: Box<dyn Write + Send> = match self.output {
            Some(path) => Box::new(
                File::create(path)
                    .map_err(|why| UsageError::new(format!("`output={path}`: {why}")))?,
            ),
            None => Box::new(io::sink()),
        };
        let connected = machine.connect(&self.wire, input, output);
        connected.map_err(|why| Ending::Failure(format!("wire `{}`: {why}", self.wire.name())))
    }
}
