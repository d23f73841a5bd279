//! What a person sees of a run besides its lines, and says to it.
//!
//! The console's input comes from standard input, byte by byte; the terminal
//! itself shows and edits the line. The status is asked for only where a person
//! looks: what a guest prints changes its times, and a run whose output goes to a
//! file or a pipe must not depend on who started it.

use std::fs;
use std::io::{ErrorKind, IsTerminal, Read, Write, stdin, stdout};
use std::path::{Path, PathBuf};
use std::process::ChildStdin;
use std::thread;
use std::time::Duration;

use super::{prove, wire};
use crate::dot;
use crate::files;
use crate::options::Parsed;
use crate::outcome::Outcome;
use crate::proof::{commits, witness};
use crate::system;

/// Returns the guest's words for what the options ask for.
pub(super) fn guest_words(options: &Parsed) -> Vec<String> {
    let mut words = Vec::new();
    if options.is_given("console") {
        words.push("console=on".into());
    } else {
        words.extend(can_stop(options).then(|| "console=stop".into()));
        words.extend(is_watched(options).then(|| "status=1".into()));
    }
    words
}

/// Reports whether the guest can be asked to end: not where standard input goes to its other port,
/// since QEMU has one such way in.
pub(super) fn can_stop(options: &Parsed) -> bool {
    let says_otherwise = options
        .text("append")
        .is_some_and(|words| words.contains("console="));
    !wire::is_live(options) && !says_otherwise
}

/// Returns the words by which runs print what the options need: commits their DAGs, and runs
/// their trace and the statistics of all jobs.
pub(super) fn dumps(options: &Parsed) -> Vec<String> {
    let mut words = Vec::new();
    words.extend(needs_graphs(options).then(|| "graph=dump".into()));
    let traces = options.given_of(&["trace", "keep"]);
    words.extend(traces.map(|_| "trace=dump".into()));
    words.extend(prove::times_word(options));
    words
}

/// Reports whether the options ask for what needs the committed DAGs.
pub(super) fn needs_graphs(options: &Parsed) -> bool {
    let names = ["dot", "trace", "keep", "witness", "observe", "prove"];
    options.given_of(&names).is_some()
}

/// Reports whether a person watches, and does not talk meanwhile.
fn is_watched(options: &Parsed) -> bool {
    let is_silent = options.given_of(&["quiet", "json", "gdb"]).is_some();
    stdout().is_terminal() && system::stderr_moves() && !is_silent
}

/// Writes the DAGs that a run has committed, if the options ask for it, and returns
/// what to say of the file.
///
/// # Errors
///
/// In words: there are none, or the file cannot be written.
pub(super) fn write_dot(options: &Parsed, outcome: &Outcome) -> Result<Option<String>, String> {
    let Some(path) = options.path("dot") else {
        return Ok(None);
    };
    files::write_named("dot", path, dot::text(&outcome.transcript)?)?;
    let file = files::place(path);
    Ok(Some(format!(
        "{file}: the committed DAGs; `dot -Tsvg {file} -o {file}.svg` draws them"
    )))
}

/// Writes the witnesses of a run's bounds, if the options ask for it, and returns what to
/// say of them.
///
/// # Errors
///
/// In words: there are none, or a file cannot be written.
pub(super) fn write_witness(options: &Parsed, outcome: &Outcome) -> Result<Option<String>, String> {
    let Some(path) = options.path("witness") else {
        return Ok(None);
    };
    witness::write(path, &commits::read(&outcome.transcript)?).map(Some)
}

/// Hands standard input on to the guest's serial port, until either ends. At its end a console's
/// last line is ended, too; a run without end is shut down then, for nobody can do so
/// any more.
///
/// Begins when the guest has written into `log`: its serial port loses what comes before
/// it is set up.
pub(super) fn relay(options: &Parsed, log: &Path) -> impl FnOnce(Option<ChildStdin>) + use<> {
    let log = log.to_path_buf();
    let is_read = options.is_given("console") || wire::is_live(options);
    let farewell = match options.number("jobs") {
        _ if !options.is_given("console") => "",
        Some(0) => "\nshutdown\n",
        _ => "\n",
    };
    move |input| {
        if let Some(input) = input.filter(|_| is_read) {
            hand_on(input, log, farewell);
        }
    }
}

fn hand_on(mut input: ChildStdin, log: PathBuf, farewell: &'static str) {
    // The thread is not waited for: it may stand in a read for ever, and ends with
    // the tool.
    thread::spawn(move || {
        let mut bytes = [0; 256];
        // A log that is gone is that of a guest that has ended.
        while fs::metadata(&log).is_ok_and(|log| log.len() == 0) {
            thread::sleep(Duration::from_millis(10));
        }
        loop {
            match stdin().read(&mut bytes) {
                Ok(0) => {
                    // The guest may have ended before.
                    let _ = input.write_all(farewell.as_bytes());
                    let _ = input.flush();
                    break;
                }
                Ok(count) => {
                    let sent = input.write_all(&bytes[..count]);
                    if sent.and_then(|()| input.flush()).is_err() {
                        break;
                    }
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => break,
            }
        }
    });
}
