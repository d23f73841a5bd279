//! The end of a run for the person: what is said of it, and the exit code.

use std::process::ExitCode;

use super::{Booted, RUN, on_linux, prove};
use crate::child::Asked;
use crate::dag_file::Prepared;
use crate::options::{BY_PERSON, Parsed, Refusal};
use crate::protocol::{Status, Transcript};
use crate::qemu::Ending;

/// Says how a run has ended, and returns the exit code.
pub(super) fn conclude(booted: &Booted, dags: Option<&Prepared>, options: &Parsed) -> ExitCode {
    let Booted {
        outcome,
        log,
        screen,
    } = booted;
    let by_person = outcome.asked == Some(Asked::ByPerson);
    let Err(fault) = outcome.judge() else {
        let (how, code) = match by_person {
            true => ("ended by ctrl-C, in order,", ExitCode::from(BY_PERSON)),
            false => ("well ended", ExitCode::SUCCESS),
        };
        let seconds = outcome.elapsed.as_secs_f64();
        screen.say(&format!("\n{how} after {seconds:.1} s"));
        log.discard();
        return code;
    };
    if prove::refused(options, &fault.reason) {
        log.restore();
        return ExitCode::from(2);
    }
    if fault.status == Status::Usage {
        let of_file = dags.and_then(|dags| dags.translate(&fault.reason));
        let who = if on_linux::is_asked_for(options) {
            "app"
        } else {
            "guest"
        };
        let lines = of_file
            .unwrap_or_else(|| format!("the {who} refused its command line: {}", fault.reason));
        let draws_nothing = options.is_given("seeds") && fault.reason.starts_with("`seed`");
        let remedy = match draws_nothing {
            true => "; this app draws nothing by a seed: leave `--seeds` out",
            false => "",
        };
        log.restore();
        return RUN.refuse(&(lines + remedy));
    }
    match outcome.transcript.verdict() {
        // The screen has shown all that it said.
        Ok(_) => eprintln!("the serial log is {}", outcome.log.display()),
        Err(_) => eprint!("{}", outcome.tail()),
    }
    let remedy = match outcome.ending {
        Ending::TimedOut { .. } => format!(
            "{}; `--timeout SECONDS` gives it longer, and a subtask that never returns is ended \
             if it has a WCET or a budget",
            stalled(&outcome.transcript)
        ),
        Ending::Guest(Status::Success) if matches!(outcome.asked, Some(Asked::ByLimit(_))) => {
            "; `--timeout SECONDS` gives it longer".into()
        }
        _ => String::new(),
    };
    let code = RUN.fail(&format!("failed: {}{remedy}", fault.reason));
    if by_person {
        return ExitCode::from(BY_PERSON);
    }
    code
}

/// Goes on to the next run, unless a person has ended this one.
pub(super) fn go_on(booted: &Booted) -> Result<(), Refusal> {
    match booted.outcome.asked {
        Some(Asked::ByPerson) => Err(Refusal::ByPerson),
        _ => Ok(()),
    }
}

/// Names the subtasks that the guest has found to keep their cores, if it has.
fn stalled(transcript: &Transcript) -> String {
    let named = transcript.of_kind("stalled").filter_map(|line| {
        let (subtask, dag) = (line.text_at("subtask_name")?, line.text_at("dag_name")?);
        let ms = line.number_at("still_ns")? / 1_000_000;
        Some(format!(
            "; subtask `{subtask}` of dag `{dag}` kept its core for more than {ms} ms of its time"
        ))
    });
    named.collect()
}
