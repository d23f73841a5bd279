//! Reference values of subtasks that wait: schedules and bounds, in one file.
//!
//! A file has blocks that begin with `case`, which are schedules, and blocks that begin with
//! `bounds`; each ends with `end`. [`bounds`] and [`schedules`] state their records and compare
//! them. In both, the waits of a subtask are on a line of its own:
//!
//! ```text
//! wait V n C_0 W_1 C_1 ..     subtask V has n >= 1 waits of the limits W between segments of the
//!                             WCETs C, which sum up to that of the subtask
//! ```

pub mod bounds;
pub mod schedules;

use std::ffi::OsString;
use std::process::ExitCode;

use replay::lines::{Line, Lines, Malformed, blocks};

use super::{FILES, NOTES, failures, read};
use crate::options::{Command, Refusal};

static WAITING: Command = Command {
    invocation: "./scripts/oracle waiting",
    about: "Compares the bounds of DAGs whose subtasks wait with those of the analysis at \
            commit. Schedules of such DAGs are read over and not compared.",
    positional: FILES,
    options: &[],
    notes: NOTES,
};

/// One block of a file.
#[derive(Debug)]
pub enum WaitingCase {
    /// A schedule.
    Schedule(schedules::ScheduleCase),
    /// Bounds of a set.
    Bounds(bounds::BoundsCase),
}

/// Reads all blocks of a file.
///
/// # Errors
///
/// [`Malformed`] for the first record that is not as described in the modules.
pub fn parse(text: &str) -> Result<Vec<WaitingCase>, Malformed> {
    blocks(text, &["case", "bounds"], parse_block)
}

fn parse_block(header: &Line<'_>, lines: &mut Lines<'_>) -> Result<WaitingCase, Malformed> {
    match header.kind {
        "bounds" => bounds::parse(header, lines).map(WaitingCase::Bounds),
        _ => schedules::parse(header, lines).map(WaitingCase::Schedule),
    }
}

/// Runs `oracle waiting`.
pub(super) fn command(words: &[OsString]) -> ExitCode {
    WAITING.carry_out(words, |options| {
        let (mut sets, mut schedules) = (Vec::new(), 0);
        for case in read(options.files(), parse).map_err(Refusal::Usage)? {
            match case {
                WaitingCase::Bounds(case) => sets.push(case),
                WaitingCase::Schedule(_) => schedules += 1,
            }
        }
        let failed = failures(&sets, bounds::check, |case| &case.name);
        println!("schedules: {schedules} not checked");
        println!("bounds: {} passed, {failed} failed", sets.len() - failed);
        Ok(ExitCode::from(u8::from(failed > 0)))
    })
}
