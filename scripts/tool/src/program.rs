//! Runs an app as a Linux program of this computer, and judges the run like a guest's.
//!
//! The program's standard output is the log. The verdict in the log and the exit code must agree,
//! as do a guest's verdict and QEMU's status.

use std::ffi::OsString;
use std::fs::File;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{ExitStatus, Stdio};
use std::time::Duration;

use end_signals::EndSignals;

use crate::child::{Child, StopReason, WaitEnd, bound_to_us};
use crate::outcome::Outcome;
use crate::qemu::RunEnd;
use crate::system;
use views::protocol::{Status, Transcript};

/// A program and the way to run it.
#[derive(Clone, Copy, Debug)]
pub struct ProgramOrder<'a> {
    /// The program.
    pub program: &'a Path,
    /// The program's arguments.
    pub words: &'a [OsString],
    /// Whether the program inherits our standard input; if not, its input is empty.
    pub is_live: bool,
    /// Whether the program ends in order at SIGINT; then the tool asks before it kills.
    pub stops: bool,
    /// The output file.
    pub log: &'a Path,
    /// The time limit.
    pub limit: Duration,
}

/// Runs a program until its end or its limit, and passes each whole line to `show` as soon as it is
/// complete.
///
/// # Errors
///
/// In words: the program could not be started, or the log could not be written or read.
pub fn run(order: &ProgramOrder<'_>, show: &mut impl FnMut(&str)) -> Result<Outcome, String> {
    run_for(order, show, ExitStatus::code)
}

/// Works like [`run`]; `code` derives the app's exit code from the end of the started program.
///
/// # Errors
///
/// As [`run`].
pub fn run_for(
    order: &ProgramOrder<'_>,
    show: &mut impl FnMut(&str),
    code: impl FnOnce(&ExitStatus) -> Option<i32>,
) -> Result<Outcome, String> {
    let &ProgramOrder {
        program,
        words,
        is_live,
        stops,
        log,
        limit,
    } = order;
    let stdin = match is_live {
        true => Stdio::inherit(),
        false => Stdio::null(),
    };
    let place = log.display();
    let file = File::create(log)
        .map_err(|error| format!("cannot write `{place}`: {error}; name a file elsewhere"))?;
    let mut command = bound_to_us(program);
    command.args(words).stdin(stdin).stdout(file);
    // A live program must stay in the terminal's process group, or it could not read the terminal;
    // there ctrl-C reaches it directly. Any other program that ends in order leaves the group, and
    // we pass the request on.
    let is_apart = stops && !is_live;
    if is_apart {
        command.process_group(0);
    }
    let mut child = Child::start(&mut command)
        .map_err(|error| format!("cannot start `{}`: {error}", program.display()))?;
    let process = child.id();
    let mut ask = |why| {
        // In our process group ctrl-C has reached the program already; a second signal would end it
        // at once.
        if is_apart || why != StopReason::ByPerson {
            EndSignals::send(process);
        }
    };
    // Without `stop` the limit kills the program at once, and ctrl-C is not caught.
    let stop: Option<&mut dyn FnMut(StopReason)> = if stops { Some(&mut ask) } else { None };
    let followed = child.follow(limit, log, show, stop, |_| Some(0))?;
    let mut outcome = Outcome {
        asked: followed.asked,
        elapsed: child.elapsed(),
        ..Outcome::of(RunEnd::Killed, followed.text, log, program)
    };
    outcome.ending = match followed.waited {
        WaitEnd::Ended(status) => ending_of(status, code(&status), &outcome.transcript),
        WaitEnd::Killed => RunEnd::Killed,
        WaitEnd::TimedOut | WaitEnd::GivenUp => RunEnd::Program(format!(
            "no end within {} s, the program was killed; {}; `--timeout SECONDS` gives it longer",
            limit.as_secs(),
            system::host_load()
        )),
    };
    Ok(outcome)
}

fn ending_of(status: ExitStatus, code: Option<i32>, transcript: &Transcript) -> RunEnd {
    let has_verdict = transcript.of_kind("verdict").next().is_some();
    // An exit code counts only with a verdict: a program may end with 0 without having run the app.
    match code.filter(|_| has_verdict) {
        Some(0) => RunEnd::Guest(Status::Success),
        Some(1) => RunEnd::Guest(Status::Failure),
        Some(2) => RunEnd::Guest(Status::Usage),
        _ => RunEnd::Program(format!(
            "the program gave no verdict and ended with {status}"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::process::ExitStatusExt as _;

    #[test]
    fn without_a_verdict_no_exit_code_counts() {
        let verdict = "{\"kind\":\"verdict\",\"status\":\"success\"}\n";
        let of = |wait_status, text| {
            let status = ExitStatus::from_raw(wait_status);
            ending_of(status, status.code(), &Transcript::read(text))
        };
        assert_eq!(of(0, verdict), RunEnd::Guest(Status::Success));
        assert_eq!(of(2 << 8, verdict), RunEnd::Guest(Status::Usage));
        for wait_status in [0, 9, 101 << 8] {
            assert!(matches!(of(wait_status, ""), RunEnd::Program(_)));
        }
        assert!(matches!(of(9, verdict), RunEnd::Program(_)));
    }
}
