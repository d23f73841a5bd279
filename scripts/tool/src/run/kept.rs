//! All of a run in one file: a recording with the run's machine lines.
//!
//! So one file has the DAGs, what was answered to their commit, each event, and the values, and
//! every command that reads a log or a recording reads it. A run that died leaves what it had
//! said and sent until then.

use std::path::Path;

use recording::{Header, Recording, Stream};

use crate::files;
use crate::options::Parsed;
use crate::outcome::Outcome;
use crate::protocol::Status;
use crate::qemu::Ending;
use crate::recordings;

/// The kinds of lines that say how far a run is, and nothing of it.
const PASSING: [&str; 2] = ["progress", "status"];

/// Writes the file that the options name, if they do, and returns what to say of it.
///
/// # Errors
///
/// In words: what was sent cannot be read, or the file cannot be written.
pub(super) fn write(
    options: &Parsed,
    sent: Option<&Path>,
    app: &str,
    outcome: &Outcome,
) -> Result<Option<String>, String> {
    let Some(path) = options.path("keep") else {
        return Ok(None);
    };
    if outcome.ending == Ending::Guest(Status::Usage) {
        return Ok(None);
    }
    let file = files::place(path);
    let sent = sent.map_or(Ok(Vec::new()), recordings::received);
    let sent = sent.map_err(|error| format!("`--keep {file}`: {error}"))?;
    // Where nothing was recorded, there is no header either.
    let sent = match Recording::read(&sent) {
        Ok(_) => sent,
        Err(_) => recording::mended(&sent).unwrap_or_default(),
    };
    let recording = Recording::read(&sent).ok();
    let header = match &recording {
        Some(recording) => recording.header().clone(),
        None => Header {
            app: app.into(),
            ..Header::default()
        },
    };
    let mut bytes = Vec::new();
    let mut send = |part: &[u8]| bytes.extend_from_slice(part);
    let mut stream = Stream::begin(&header, &mut send);
    for entry in recording.iter().flat_map(Recording::entries) {
        stream.write(&entry, &mut send);
    }
    let lines = outcome.transcript.machine.iter();
    let lasting = lines.filter(|line| !PASSING.contains(&line.kind.as_str()));
    let lines: String = lasting.map(|line| line.text.clone() + "\n").collect();
    stream.text(&lines, &mut send);
    let is_whole = outcome.transcript.verdict().is_ok();
    match is_whole && !recording.is_some_and(|recording| recording.is_cut()) {
        true => stream.end(&mut send),
        false => stream.cut(&mut send),
    }
    files::write_named("keep", path, &bytes)?;
    let how = if is_whole { "" } else { "until it died, " };
    Ok(Some(format!(
        "{file}: all of the run, {how}{} bytes; `./scripts/check-trace {file}` judges it, \
         `./scripts/trace {file} -o {file}.json` draws it, `./scripts/recording {file}` shows what \
         is recorded, and `--replay {file}` repeats it",
        bytes.len()
    )))
}
