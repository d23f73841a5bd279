//! Reference values of subtasks that wait: schedules and bounds, in one file.
//!
//! A file has blocks that begin with `case`, which are [schedules], and blocks that begin with
//! `bounds`, which [`bounds`] reads; each ends with `end`. In both, the waits of a subtask are on a
//! line of its own:
//!
//! ```text
//! wait V n C_0 W_1 C_1 ..     subtask V has n >= 1 waits of the limits W between segments of the
//!                             WCETs C, which sum up to that of the subtask
//! ```

pub mod bounds;

use std::ffi::OsString;
use std::process::ExitCode;

use replay::lines::{Malformed, blocks};
use replay::parse_block;

use super::schedules::{self, Case};
use super::{FILES, NOTES, in_kernel, run_files};
use crate::options::{Command, Takes, options};

static WAITING: Command = Command {
    invocation: "./scripts/oracle waiting",
    about: "Compares schedules of subtasks that wait with those of the scheduler in virtual time, \
            and bounds with those of the analysis at commit.",
    positional: FILES,
    options: options! {
        /// The schedules alone, on the bare machine; see schedules --in-kernel --help.
        "in-kernel": Takes::Nothing;
    },
    notes: NOTES,
};

/// One block of a file.
#[derive(Debug)]
pub enum WaitingCase {
    /// A schedule.
    Schedule(Box<Case>),
    /// Bounds of a set.
    Bounds(bounds::WaitingBounds),
}

/// Reads all blocks of a file.
///
/// # Errors
///
/// [`Malformed`] for the first record that is not as described in the modules.
pub fn parse(text: &str) -> Result<Vec<WaitingCase>, Malformed> {
    blocks(text, &["case", "bounds"], |header, lines| {
        match header.kind {
            "bounds" => bounds::parse(header, lines).map(WaitingCase::Bounds),
            _ => parse_block(text, header, lines).map(|case| WaitingCase::Schedule(Box::new(case))),
        }
    })
}

/// Reads all blocks of a file, and returns the schedules.
fn parse_schedules(text: &str) -> Result<Vec<Case>, Malformed> {
    let schedule = |case| match case {
        WaitingCase::Schedule(case) => Some(*case),
        WaitingCase::Bounds(_) => None,
    };
    Ok(parse(text)?.into_iter().filter_map(schedule).collect())
}

/// Compares everything that a block states.
///
/// # Errors
///
/// The first difference, in one line.
pub fn check(case: &WaitingCase) -> Result<(), String> {
    match case {
        WaitingCase::Schedule(case) => schedules::check(case),
        WaitingCase::Bounds(case) => bounds::check(case),
    }
}

fn name(case: &WaitingCase) -> &str {
    match case {
        WaitingCase::Schedule(case) => &case.name,
        WaitingCase::Bounds(case) => &case.name,
    }
}

/// Runs `oracle waiting`.
pub(super) fn command(words: &[OsString]) -> ExitCode {
    if words.iter().any(|word| word == "--in-kernel") {
        return in_kernel::command(words, parse_schedules);
    }
    run_files(words, &WAITING, parse, check, name)
}
