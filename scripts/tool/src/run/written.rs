//! The files that the options want of a run, besides its log.

use super::log::Log;
use super::recording::Recorded;
use super::screen::Screen;
use super::{Booted, kept, seeing, wire};
use crate::files;
use crate::options::{Parsed, Refusal};
use crate::outcome::Outcome;

/// Writes what the options want in files of a run, and says so; of a run that has failed it speaks
/// only of trace and recording.
pub(super) fn write(
    options: &Parsed,
    recorded: &Recorded,
    outcome: Outcome,
    log: Log,
    screen: Screen,
) -> Result<Booted, Refusal> {
    if let Some(file) = options.path("trace").map(files::place) {
        screen.say(&format!(
            "{file}: the log with its trace; `./scripts/check-trace {file}` judges it, \
             `./scripts/trace {file} -o {file}.json` draws it"
        ));
    }
    let kept = kept::write(options, recorded.raw().as_deref(), recorded.app(), &outcome)?;
    for line in recorded.write(options, &outcome)?.iter().chain(&kept) {
        screen.say(line);
    }
    let written = [
        seeing::write_dot(options, &outcome),
        seeing::write_witness(options, &outcome),
        Ok(wire::warning(options, &outcome)),
    ];
    // Else there are worse news.
    if outcome.judge().is_ok() {
        for line in written {
            line?.iter().for_each(|line| screen.say(line));
        }
    }
    Ok(Booted {
        outcome,
        log,
        screen,
    })
}
