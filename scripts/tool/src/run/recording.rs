//! What a guest records, or has kept before a fault, and what it replays.
//!
//! The guest sends a recording as it comes, and the tool keeps these bytes in a file of its own
//! until the run is over: what the person names is one whole recording, or what it was before.
//! What nobody has named, because nobody expects a fault, goes next to the logs.

use std::fs;
use std::path::{Path, PathBuf};

use crate::files::{self, Temporary};
use crate::options::{Parsed, Refusal};
use crate::outcome::Outcome;
use crate::protocol::Status;
use crate::qemu::Ending;
use crate::recordings;
use crate::system;

/// The bytes that a guest sends; none in a replay.
pub(super) struct Recorded {
    raw: Temporary,
    app: String,
    /// The word that asks for all of the run, if the person wants that.
    word: Option<&'static str>,
}

impl Recorded {
    /// Settles where they go.
    pub(super) fn new(options: &Parsed, app: &str) -> Result<Recorded, String> {
        let is_wanted = !options.is_given("replay");
        let path = is_wanted.then(|| system::new_log(app)).transpose()?;
        let path = path.map(|path| path.with_extension("sent"));
        Ok(Recorded {
            raw: Temporary(path),
            app: app.into(),
            word: options.given_of(&["record", "keep"]).filter(|_| is_wanted),
        })
    }

    pub(super) fn raw(&self) -> Option<PathBuf> {
        self.raw.0.clone()
    }

    pub(super) fn app(&self) -> &str {
        &self.app
    }

    pub(super) const fn word(&self) -> Option<&'static str> {
        self.word
    }

    /// Returns the word with its value, after a blank: how many KiB may wait in the guest.
    pub(super) fn guest_word(&self) -> String {
        let with_room = |word| format!(" {word}=1024");
        self.word.map_or_else(String::new, with_room)
    }

    /// Writes the file that the person has named, and returns what to say of it. What a run has
    /// left that died is made a recording that says so.
    pub(super) fn write(
        &self,
        options: &Parsed,
        outcome: &Outcome,
    ) -> Result<Option<String>, String> {
        let Some(raw) = &self.raw.0 else {
            return Ok(None);
        };
        let Some(path) = options.path("record") else {
            return match self.word {
                None => self.write_crash(raw),
                Some(_) => Ok(None),
            };
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
        files::write_named("record", path, &bytes)?;
        Ok(Some(format!(
            "{file}: a recording, {how}{} bytes; `./scripts/recording {file}` shows it",
            bytes.len()
        )))
    }

    /// Writes what the guest has kept of the jobs before a fault, if there was one.
    fn write_crash(&self, raw: &Path) -> Result<Option<String>, String> {
        // No guest, no file.
        let bytes = recordings::received(raw).unwrap_or_default();
        if recording::Recording::read(&bytes).is_err() {
            return Ok(None);
        }
        let path = raw.with_extension("rec");
        let file = files::place(&path);
        fs::write(&path, &bytes).map_err(|error| format!("{file}: cannot be written: {error}"))?;
        let shown = self.replay_package().map_or(String::new(), |package| {
            format!(
                ", and `cargo run --profile host{package} --example replay -- {file}` shows the job \
                 that crashed"
            )
        });
        Ok(Some(format!(
            "{file}: the inputs of the last jobs before the fault; `./scripts/recording {file}` \
             lists them{shown}"
        )))
    }

    /// Returns how cargo is told the package whose example replays, if there is one: nothing has
    /// to be said in the app's own repository.
    fn replay_package(&self) -> Option<String> {
        const EXAMPLE: &str = "examples/replay.rs";
        let app = &self.app;
        let is_ours = (system::workspace().join("apps").join(app).join(EXAMPLE)).is_file();
        let in_its_own = || Path::new(EXAMPLE).is_file().then(String::new);
        is_ours.then(|| format!(" -p {app}")).or_else(in_its_own)
    }
}

/// Reads the recording that `--replay` names for a guest, if it does, and makes sure that it is
/// one. A program of Linux reads it itself.
pub(super) fn read(options: &Parsed) -> Result<Vec<u8>, Refusal> {
    let Some(path) = options.path("replay") else {
        return Ok(Vec::new());
    };
    let refused = |why| Refusal::Usage(format!("`--replay` {why}"));
    let bytes = recordings::read(path).map_err(refused)?;
    recordings::parse(path, &bytes).map_err(refused)?;
    match options.is_given("on") {
        true => Ok(Vec::new()),
        false => Ok(bytes),
    }
}
