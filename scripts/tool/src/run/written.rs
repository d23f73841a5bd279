//! The files that the options want of a run, besides its log.

use super::screen::Screen;
use super::{Booted, seeing, wire};
use crate::files;
use crate::options::{Parsed, Refusal};

/// Says where the trace is, if there is one.
pub(super) fn say_trace(screen: &Screen, options: &Parsed) {
    if let Some(file) = options.path("trace").map(files::place) {
        screen.say(&format!(
            "{file}: the log with its trace; `./scripts/check-trace {file}` judges it, \
             `./scripts/trace {file} -o {file}.json` draws it"
        ));
    }
}

/// Writes what the options want in files of a run, and says so, if all was well.
pub(super) fn write(options: &Parsed, booted: &Booted) -> Result<(), Refusal> {
    let outcome = &booted.outcome;
    for written in [
        seeing::write_dot(options, outcome),
        seeing::write_witness(options, outcome),
        Ok(wire::warning(options, outcome)),
    ] {
        if outcome.judge().is_err() {
            // There are worse news.
            break;
        }
        if let Some(line) = written? {
            booted.screen.say(&line);
        }
    }
    Ok(())
}
