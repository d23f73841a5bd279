//! Shows the output of a run while it goes on, and passes a person's input to the guest.
//!
//! Lines for people and machine lines go to standard output in the order of the serial log, so
//! `grep '^{'` works on this output as on the log itself. Progress lines become a single line on
//! standard error, as in every command. On a terminal, status lines take its place. After a fault
//! at an address, a line of our own names the function.
//!
//! The console's input comes from standard input, byte by byte; the terminal itself shows and edits
//! the line. Only on a terminal does the tool ask for the status: printing changes a guest's times,
//! and a run with output to a file or a pipe must not depend on the caller.

use std::fs;
use std::io::{ErrorKind, IsTerminal, Read, Write, stdin, stdout};
use std::path::{Path, PathBuf};
use std::process::ChildStdin;
use std::thread;
use std::time::{Duration, Instant};

use super::handed;
use crate::options::CommandLine;
use crate::places;
use crate::progress::Progress;
use crate::run_options::name;
use crate::system;
use views::protocol::{MachineLine, read_line};

/// The value of `quiet` for suppressing machine lines, too, in a run that only prepares another
/// run.
pub(super) const NOTHING: &str = "nothing";

/// The destinations of each kind of line.
pub(super) struct RunDisplay {
    people: bool,
    machine: bool,
    quiet: bool,
    on_terminal: bool,
    bar_is_shown: bool,
    /// The arrival of the first status line, and the run's time in that line.
    first_status: Option<(Instant, u64)>,
    /// The progress of this run, and the number of finished jobs.
    progress: Option<(Progress, u64)>,
    image: PathBuf,
}

impl RunDisplay {
    pub(super) fn new(options: &CommandLine, image: &Path) -> RunDisplay {
        RunDisplay {
            people: !options.is_given(name::JSON),
            machine: options.text(name::QUIET) != Some(NOTHING)
                && (options.is_given(name::JSON) || !options.is_given(name::CONSOLE)),
            quiet: options.is_given(name::QUIET),
            on_terminal: system::stderr_moves(),
            bar_is_shown: false,
            first_status: None,
            progress: None,
            image: image.into(),
        }
    }

    /// Prints a line of our own, unless `--quiet` is given.
    pub(super) fn say(&self, line: &str) {
        if self.quiet {
            return;
        }
        if self.people {
            println!("{line}");
        } else {
            // Standard output is for machine lines only in this case.
            eprintln!("{line}");
        }
    }

    /// Shows a line of the serial log.
    pub(super) fn show(&mut self, line: &str) {
        // The number serves only messages, and those come from the judge.
        let read = read_line(0, line);
        if let Some(Ok(machine)) = &read {
            match machine.kind.as_str() {
                "progress" => return self.advance(machine),
                // Records are written to files; on the screen they tell nothing.
                "record" => return,
                "status" if self.on_terminal => return self.show_status(machine),
                _ => {}
            }
        }
        let wanted = if read.is_some() {
            self.machine
        } else {
            self.people
        };
        if wanted {
            // A progress line may be there; the new line would begin behind it.
            self.wipe();
            println!("{line}");
        }
        if let Some(place) = places::explain(&self.image, line) {
            self.wipe();
            self.say(&format!("  {place}"));
        }
    }

    /// Wipes the progress line away.
    pub(super) fn wipe(&mut self) {
        if std::mem::take(&mut self.bar_is_shown) {
            eprint!("\r\x1b[K");
        }
    }

    fn show_status(&mut self, line: &MachineLine) {
        if let Some(text) = self.status_text(line).filter(|_| !self.quiet) {
            eprint!("\r\x1b[K{text}");
            self.bar_is_shown = true;
        }
    }

    /// Describes the run's state in one line; `None` if the machine line lacks a member.
    fn status_text(&mut self, line: &MachineLine) -> Option<String> {
        let now = Instant::now();
        let time_ns = line.number_at("time_ns")?;
        let (since, since_ns) = match self.first_status {
            // A second run of the same boot counts from 0 again.
            Some(first) if first.1 <= time_ns => first,
            _ => *self.first_status.insert((now, time_ns)),
        };
        let wall_ns = u64::try_from((now - since).as_nanos()).unwrap_or(u64::MAX);
        describe(line, wall_ns, time_ns - since_ns)
    }

    fn advance(&mut self, line: &MachineLine) {
        let (Some(done), Some(total)) = (line.number_at("done"), line.number_at("total")) else {
            return;
        };
        if self.quiet || total == 0 {
            return;
        }
        // A second run of the same boot counts from 0 again, and gets a new estimate.
        let begun = self.progress.take().filter(|(_, before)| *before <= done);
        let begun = begun.map(|(progress, _)| progress);
        let mut progress = begun.unwrap_or_else(|| Progress::new(total, "jobs"));
        progress.show(done.min(total));
        self.progress = Some((progress, done));
        self.bar_is_shown = self.on_terminal;
    }
}

/// The longest line in bytes, so that a narrow terminal does not break it.
const WIDTH: usize = 100;

/// Describes the run after `wall_ns` of real time and `run_ns` of the run's own time.
fn describe(line: &MachineLine, wall_ns: u64, run_ns: u64) -> Option<String> {
    let (done, total) = (line.number_at("done")?, line.number_at("total")?);
    let misses = line.number_at("misses")?;
    let jobs = match total {
        0 => format!("{done} jobs"),
        _ => format!("{done} of {total} jobs"),
    };
    let mut text = format!("{jobs}, {misses} missed");
    let loads = line.value.get("load_permille")?.elements();
    let percent = |load: &views::json::Value| Some((load.as_u64()? + 5) / 10);
    let loads: Vec<String> = loads
        .iter()
        .filter_map(percent)
        .map(|load| load.to_string())
        .collect();
    if !loads.is_empty() {
        text += &format!(", load {} %", loads.join(" "));
    }
    // Before any time has passed there is no speed to extrapolate from.
    if let Some(left_ns) = line.number_at("left_ns").filter(|_| run_ns > 0) {
        // In 128 bits: two times in ns multiplied exceed 64 bits within seconds.
        let left_ns = u128::from(left_ns) * u128::from(wall_ns) / u128::from(run_ns);
        text += &format!(", {} s left", left_ns.div_ceil(1_000_000_000));
    }
    if text.len() > WIDTH {
        // The cut must not fall into the middle of a character.
        text.truncate(text.floor_char_boundary(WIDTH - 2));
        text += "..";
    }
    Some(text)
}

/// Returns the guest's words needed for the screen.
pub(super) fn guest_words(options: &CommandLine) -> Vec<String> {
    let mut words = Vec::new();
    if options.is_given(name::CONSOLE) {
        words.push("console=on".into());
    } else {
        words.extend(can_stop(options).then(|| "console=stop".into()));
        words.extend(is_watched(options).then(|| "status=1".into()));
    }
    words
}

/// Reports whether the tool can ask the guest to end by ctrl-C. It cannot if standard input feeds
/// the guest's second port, since QEMU has only one standard input, or if the person's own words
/// set `console=`.
pub(super) fn can_stop(options: &CommandLine) -> bool {
    let says_otherwise = options
        .text(name::APPEND)
        .is_some_and(|words| words.contains("console="));
    !handed::is_live(options) && !says_otherwise
}

/// Reports whether a person watches without typing.
fn is_watched(options: &CommandLine) -> bool {
    let is_silent = options
        .given_of(&[name::QUIET, name::JSON, name::GDB])
        .is_some();
    stdout().is_terminal() && system::stderr_moves() && !is_silent
}

/// Copies standard input to the guest's serial port until either ends. At the end of input,
/// completes a console's last line; also shuts down an endless run, since no later input could do
/// so.
///
/// Starts when the guest has written to `log`: before the guest sets up its serial port, input is
/// lost.
pub(super) fn relay(options: &CommandLine, log: &Path) -> impl FnOnce(Option<ChildStdin>) + use<> {
    let log = log.to_path_buf();
    let is_read = options.is_given(name::CONSOLE) || handed::is_live(options);
    let farewell = match options.number(name::JOBS) {
        _ if !options.is_given(name::CONSOLE) => "",
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
    // The thread is never joined: it may block in a read until the tool ends.
    thread::spawn(move || {
        let mut bytes = [0; 256];
        // The log is removed when the guest has ended; then the wait ends, too.
        while fs::metadata(&log).is_ok_and(|log| log.len() == 0) {
            thread::sleep(Duration::from_millis(10));
        }
        loop {
            match stdin().read(&mut bytes) {
                Ok(0) => {
                    // An error is ignored: the guest may have ended already.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn described(rest: &str, wall_ns: u64, run_ns: u64) -> Option<String> {
        let text = format!("{{\"kind\":\"status\",\"time_ns\":5000000000,\"done\":12,{rest}}}");
        let line = read_line(1, &text).expect("a machine line");
        describe(&line.expect("good"), wall_ns, run_ns)
    }

    #[test]
    fn says_jobs_misses_load_and_time_left_as_far_as_they_are_known() {
        let full =
            "\"total\":60,\"misses\":3,\"load_permille\":[894,1000,4],\"left_ns\":9000000000";
        let text = described(full, 2_000_000_000, 3_000_000_000);
        let expected = "12 of 60 jobs, 3 missed, load 89 100 0 %, 6 s left";
        assert_eq!(text.as_deref(), Some(expected));
        // At the first line the speed is unknown.
        let expected = expected.strip_suffix(", 6 s left");
        assert_eq!(described(full, 0, 0).as_deref(), expected);
        let endless = "\"total\":0,\"misses\":0,\"load_permille\":[]";
        let expected = Some("12 jobs, 0 missed");
        assert_eq!(described(endless, 1, 1).as_deref(), expected);
        let loads = ["1000"; 64].join(",");
        let many = format!("\"total\":60,\"misses\":3,\"load_permille\":[{loads}]");
        assert_eq!(described(&many, 1, 1).map(|it| it.len()), Some(WIDTH));
    }
}
