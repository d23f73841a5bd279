//! The files that the options want of a run, besides its log.

use super::kept::{self, Kept};
use super::log::Log;
use super::screen::Screen;
use super::{Booted, wire};
use crate::options::{Parsed, Refusal};
use crate::outcome::Outcome;

/// Writes what the options want in files of a run, and says so; of a run that has failed it speaks
/// only of trace and recording.
pub(super) fn write(
    options: &Parsed,
    kept: &Kept,
    mut outcome: Outcome,
    log: Log,
    screen: Screen,
) -> Result<Booted, Refusal> {
    kept.receive(&mut outcome)?;
    for line in kept.write(options, &outcome)? {
        screen.say(&line);
    }
    // Else there are worse news.
    if outcome.judge().is_ok() {
        let views = kept::write_views(options, &outcome)?;
        let warning = wire::warning(options, &outcome);
        views
            .iter()
            .chain(&warning)
            .for_each(|line| screen.say(line));
    }
    Ok(Booted {
        outcome,
        log,
        screen,
    })
}
