//! Outcomes of guest runs, and the judgement of them.
//!
//! At the end of a run two witnesses must agree: QEMU's exit status and the verdict, the last line
//! of the serial log. A run is good only if both are there and say success, no machine line is
//! damaged, and no line reports a violation. A single witness proves nothing: a guest could print
//! success and then hang, or end in success without having printed anything.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ChildStdin;
use std::time::Duration;

use crate::child::StopReason;
use crate::files;
use crate::medium::BootStick;
use crate::places;
use crate::qemu::{Qemu, RunEnd};
use crate::system;
use views::protocol::{MachineLine, Status, Transcript, Verdict};
use views::record::Record;

/// The number of serial lines shown at a failure, counted from the end.
const SHOWN_LINES: usize = 30;

/// The outcome of one guest's run.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// How QEMU ended.
    pub ending: RunEnd,
    /// The whole serial log; invalid UTF-8 is replaced.
    pub serial: String,
    /// The parsed log.
    pub transcript: Transcript,
    /// The bytes of the record, whichever way they came; empty if no record was kept.
    pub sent: Vec<u8>,
    /// The path of the log.
    pub log: PathBuf,
    /// The path of the booted image.
    pub image: PathBuf,
    /// The reason for asking the guest to end early, if anybody asked.
    pub asked: Option<StopReason>,
    /// The wall time from start to end.
    pub elapsed: Duration,
    /// QEMU's own error output; mostly empty.
    pub complaints: String,
}

/// Boots `image`, passes each whole serial line to `show` as soon as it is complete, and waits for
/// the end.
///
/// # Errors
///
/// In words: QEMU could not be started, or the log could not be read.
pub fn boot(
    qemu: &Qemu,
    image: &Path,
    log: &Path,
    limit: Duration,
    show: impl FnMut(&str),
) -> Result<Outcome, String> {
    boot_with_input(qemu, image, log, limit, drop, show)
}

/// Works like [`boot()`]. As soon as the guest runs, passes the input of its serial port, if there
/// is such a port, to `talk`.
///
/// # Errors
///
/// The errors of [`boot()`].
pub fn boot_with_input(
    qemu: &Qemu,
    image: &Path,
    log: &Path,
    limit: Duration,
    talk: impl FnOnce(Option<ChildStdin>),
    mut show: impl FnMut(&str),
) -> Result<Outcome, String> {
    let needs_stick = qemu.loader.needs_stick();
    let medium = needs_stick.then(|| {
        qemu.check_words()?;
        let module = qemu.module.as_deref();
        BootStick::new(image, &qemu.guest_words, module)
    });
    let medium = medium.transpose()?;
    let loaded = medium.as_ref().map_or(image, BootStick::path);
    let mut running = qemu.start(loaded, log)?;
    talk(running.child.input());
    let (ending, serial) = running.follow(limit, &mut show)?;
    Ok(Outcome {
        asked: running.asked,
        elapsed: running.child.elapsed(),
        complaints: running.complaints(),
        ..Outcome::of(ending, serial, log, image)
    })
}

const fn failure(reason: String) -> Verdict {
    let status = Status::Failure;
    Verdict { status, reason }
}

/// Judges the lines of a guest: no machine line may be damaged, the verdict must be success, and no
/// line may report a violation.
///
/// # Errors
///
/// The guest's own verdict, or the first reason against success.
pub fn judge_lines(transcript: &Transcript) -> Result<(), Verdict> {
    let verdict = transcript.verdict().map_err(failure)?;
    if let Some(fault) = transcript.faults.first() {
        return Err(failure(fault.clone()));
    }
    if verdict.status != Status::Success {
        return Err(verdict);
    }
    let violated = |line: &&MachineLine| line.number_at("violations").is_some_and(|n| n > 0);
    match transcript.machine.iter().find(violated) {
        Some(line) => Err(failure(format!(
            "serial line {} reports violations in spite of the verdict",
            line.number
        ))),
        None => Ok(()),
    }
}

impl Outcome {
    /// Reads and returns the record of the boot.
    ///
    /// # Errors
    ///
    /// In words: the fault in the record.
    pub fn record(&self) -> Result<Record, String> {
        match self.sent.is_empty() {
            true => Record::of_log(&self.serial),
            false => Record::sent(&self.sent, &self.serial),
        }
    }

    /// Makes the outcome of a guest that nobody asked to end, without complaints of QEMU's.
    pub fn of(ending: RunEnd, serial: String, log: &Path, image: &Path) -> Outcome {
        Outcome {
            ending,
            transcript: Transcript::read(&serial),
            serial,
            sent: Vec::new(),
            log: log.into(),
            image: image.into(),
            asked: None,
            elapsed: Duration::ZERO,
            complaints: String::new(),
        }
    }

    /// Judges the run by both witnesses.
    ///
    /// # Errors
    ///
    /// The guest's own verdict, or the first reason against success.
    pub fn judge(&self) -> Result<(), Verdict> {
        // The kernel prints a verdict before it writes to the exit port. So a status from that port
        // without a verdict comes from the app.
        let is_odd = matches!(self.ending, RunEnd::Status(status) if status > 1 && status % 2 == 1);
        if (is_odd || matches!(self.ending, RunEnd::Guest(_)))
            && self.transcript.of_kind("verdict").next().is_none()
        {
            let why = files::why_full(&self.log).map_or_else(
                || {
                    "the kernel gave no verdict: the app has written to QEMU's exit port itself"
                        .into()
                },
                |why| {
                    let log = files::shown_path(&self.log);
                    format!("its log {log} has no end: {why}; make room, or name a file elsewhere")
                },
            );
            return Err(failure(format!("{}, but {why}", self.ending)));
        }
        let RunEnd::Guest(by_exit) = self.ending else {
            // QEMU handles such signals itself and ends with the status of a shutdown.
            let mut reason = match self.ending {
                _ if self.complaints.contains("terminating on signal") => {
                    RunEnd::Signal.to_string()
                }
                RunEnd::Status(0) if self.serial.is_empty() => "it ended without an exit status, \
                    and nothing was printed: a triple fault before the first line, or a program \
                    that is not QEMU"
                    .into(),
                _ => self.ending.to_string(),
            };
            if !self.complaints.is_empty() {
                // Writing into a `String` cannot fail.
                let _ = write!(reason, "; QEMU says: {}", self.complaints);
            }
            return Err(failure(reason));
        };
        let verdict = self.transcript.verdict().map_err(failure)?;
        // A guest may have printed success and then failed on the way to its exit.
        if verdict.status != by_exit {
            return Err(failure(format!(
                "the verdict line says {:?}, QEMU's exit status {by_exit:?}",
                verdict.status
            )));
        }
        // Last: a fault in the log says more than the limit does.
        judge_lines(&self.transcript)?;
        match self.asked {
            Some(StopReason::ByLimit(limit)) => Err(failure(format!(
                "no end within {} s, so it was ended in order; {}",
                limit.as_secs_f64(),
                system::host_load()
            ))),
            _ => Ok(()),
        }
    }

    /// Returns the last serial lines, indented, and the path of the whole log. Adds the function's
    /// name after a fault at an address.
    pub fn tail(&self) -> String {
        // Lines of kind `record` are of no use to people.
        let lines = self.serial.lines();
        let lines = lines.filter(|line| !line.starts_with("{\"kind\":\"record\""));
        let lines: Vec<&str> = lines.collect();
        let shown = &lines[lines.len().saturating_sub(SHOWN_LINES)..];
        let mut text = String::new();
        let log = self.log.display();
        // Writing into a `String` cannot fail.
        let _ = match lines.len() {
            0 => writeln!(text, "the guest printed nothing; its log is {log}"),
            all if all > SHOWN_LINES => {
                writeln!(
                    text,
                    "the last {SHOWN_LINES} of {all} serial lines of {log}:"
                )
            }
            _ => writeln!(text, "the serial log {log}:"),
        };
        for line in shown {
            let _ = writeln!(text, "  | {line}");
            if let Some(place) = places::explain(&self.image, line) {
                let _ = writeln!(text, "  = {place}");
            }
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VERDICT: &str = "{\"kind\":\"verdict\",\"status\":\"success\",\"reason\":\"\"}\n";
    const USAGE: &str = "{\"kind\":\"verdict\",\"status\":\"usage\",\"reason\":\"`x=1`: no\"}\n";

    fn outcome(ending: RunEnd, serial: &str) -> Outcome {
        let (log, image) = (Path::new("the.log"), Path::new("the image"));
        Outcome::of(ending, serial.into(), log, image)
    }

    #[test]
    fn a_run_is_good_only_if_both_witnesses_say_so_and_nothing_is_damaged() {
        let success = || RunEnd::Guest(Status::Success);
        assert_eq!(outcome(success(), VERDICT).judge(), Ok(()));
        let timed_out = RunEnd::TimedOut {
            limit: Duration::from_millis(1500),
            load: "the load".into(),
        };
        let no_verdict = ", but the kernel gave no verdict: the app has written to";
        let damaged = format!("{{\"kind\":\n{VERDICT}");
        let violated = format!("{{\"kind\":\"own\",\"violations\":3}}\n{VERDICT}");
        let other = "the verdict line says Usage, QEMU's exit status Success";
        let damage = "serial line 1: column 9: the line ends where a value must stand";
        for (ending, serial, parts) in [
            (success(), "", ["the guest ended in success", no_verdict]),
            (
                RunEnd::Status(5),
                "x\n",
                ["ended with status 5", no_verdict],
            ),
            (RunEnd::Status(1), "", ["QEMU ended with status 1", ""]),
            (success(), USAGE, [other, ""]),
            (
                timed_out,
                VERDICT,
                ["no end within 1.5 s, QEMU was", "; the load"],
            ),
            (RunEnd::Status(0), VERDICT, ["triple fault", ""]),
            (RunEnd::Status(0), "", ["a program that is not QEMU", ""]),
            (success(), &damaged, [damage, ""]),
            (
                success(),
                &violated,
                ["serial line 1 reports violations", ""],
            ),
        ] {
            let reason = outcome(ending, serial).judge().unwrap_err().reason;
            assert!(parts.iter().all(|part| reason.contains(part)), "{reason}");
        }
        let ended = Outcome {
            complaints: "terminating on signal 15 from pid 7".into(),
            ..outcome(RunEnd::Status(0), VERDICT)
        };
        let reason = ended.judge().unwrap_err().reason;
        assert!(reason.starts_with("a signal ended QEMU; QEMU says: terminating"));
    }

    #[test]
    fn a_refused_command_line_is_told_from_a_failure() {
        let usage = RunEnd::Guest(Status::Usage);
        let (status, reason) = (Status::Usage, "`x=1`: no".into());
        let refused = Verdict { status, reason };
        assert_eq!(outcome(usage, USAGE).judge(), Err(refused));
    }

    #[test]
    fn the_tail_shows_the_last_lines_and_the_place_of_all() {
        let long: String = (1..=40).map(|n| format!("line {n}\n")).collect();
        let tail = outcome(RunEnd::Signal, &long).tail();
        assert!(tail.starts_with("the last 30 of 40 serial lines of the.log:\n  | line 11\n"));
        assert!(tail.ends_with("  | line 40\n"));
        let tail = outcome(RunEnd::Signal, "").tail();
        assert_eq!(tail, "the guest printed nothing; its log is the.log\n");
    }
}
