//! What a guest records, and what it replays.
//!
//! The guest sends a recording as it comes, and the tool keeps these bytes in a file of its own
//! until the run is over: what the person names is one whole recording, or what it was before.

use std::fs;
use std::path::PathBuf;

use super::Refusal;
use crate::files::{self, Temporary};
use crate::options::Parsed;
use crate::outcome::Outcome;
use crate::protocol::Status;
use crate::qemu::Ending;
use crate::recordings;
use crate::system;

/// The bytes that a guest sends; none if the options do not ask for them.
pub(super) struct Recorded(Temporary);

impl Recorded {
    /// Settles where they go.
    pub(super) fn new(options: &Parsed) -> Result<Recorded, String> {
        let is_given = options.is_given("record");
        let path = is_given.then(|| system::new_log("recording")).transpose()?;
        let path = path.map(|path| path.with_extension("rec"));
        Ok(Recorded(Temporary(path)))
    }

    pub(super) fn raw(&self) -> Option<PathBuf> {
        self.0.0.clone()
    }

    /// Returns the word that asks for it, after a blank: how many KiB may wait in the guest.
    pub(super) const fn guest_word(&self) -> &'static str {
        match self.0.0 {
            Some(_) => " record=1024",
            None => "",
        }
    }

    /// Writes the file that the person has named, and returns what to say of it. What a run has
    /// left that died is made a recording that says so.
    pub(super) fn write(
        &self,
        options: &Parsed,
        outcome: &Outcome,
    ) -> Result<Option<String>, String> {
        let (Some(path), Some(raw)) = (options.path("record"), &self.0.0) else {
            return Ok(None);
        };
        if outcome.ending == Ending::Guest(Status::Usage) {
            return Ok(None);
        }
        let file = files::place(path);
        let bytes =
            recordings::received(raw).map_err(|error| format!("`--record {file}`: {error}"))?;
        let (bytes, how) = match recording::Recording::read(&bytes) {
            Ok(recording) if recording.is_cut() || recording.lost() > 0 => (bytes, "incomplete, "),
            Ok(_) => (bytes, ""),
            Err(_) => match recording::mended(&bytes) {
                Ok(mended) => (mended, "incomplete, for the run died, "),
                Err(_) => return Ok(Some(format!("{file}: not written, nothing was recorded"))),
            },
        };
        fs::write(path, &bytes)
            .map_err(|error| format!("`--record {file}`: cannot be written: {error}"))?;
        Ok(Some(format!(
            "{file}: a recording, {how}{} bytes; `./scripts/recording {file}` shows it",
            bytes.len()
        )))
    }
}

/// Reads the recording that `--replay` names, if it does, and makes sure that it is one.
pub(super) fn read(options: &Parsed) -> Result<Vec<u8>, Refusal> {
    let Some(path) = options.path("replay") else {
        return Ok(Vec::new());
    };
    let refused = |why| Refusal::Usage(format!("`--replay` {why}"));
    let bytes = recordings::read(path).map_err(refused)?;
    recordings::parse(path, &bytes).map_err(refused)?;
    Ok(bytes)
}
