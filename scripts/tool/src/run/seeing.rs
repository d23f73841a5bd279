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

use super::wire;
use crate::options::Parsed;
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

/// Reports whether a person watches, and does not talk meanwhile.
fn is_watched(options: &Parsed) -> bool {
    let is_silent = options.given_of(&["quiet", "json", "gdb"]).is_some();
    stdout().is_terminal() && system::stderr_moves() && !is_silent
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
