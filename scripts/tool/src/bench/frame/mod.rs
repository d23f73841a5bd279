//! The frame that all measurements share.
//!
//! - [`Figure`]: one measured quantity, and its JSON;
//! - [`Table`]: figures for people;
//! - [`judged`]: a run whose lines are read if it is good, a guest's or a program's;
//! - [`draw`]: pictures, by the scripts of `scripts/plot`;
//! - [`code`]: the instructions of an image.

pub(super) mod code;
mod figure;
mod plots;
mod table;

use std::ffi::OsString;
use std::fmt::Display;
use std::fs;
use std::path::Path;
use std::process::ExitCode;

use crate::options::{Command, Parsed, Refusal};
use crate::outcome::Outcome;
use crate::system;

pub(super) use figure::Figure;
pub(super) use plots::draw;
pub(super) use table::{Column, Table};

/// Runs a measurement: `measure` gets what `plan` makes of the options, and says whether all limits
/// hold.
pub(super) fn by_plan<Plan>(
    table: &Command,
    words: &[OsString],
    plan: impl Fn(&Parsed) -> Result<Plan, String>,
    measure: impl Fn(&Plan) -> Result<bool, String>,
) -> ExitCode {
    table.carry_out(words, |options| {
        let plan = plan(options).map_err(Refusal::Usage)?;
        let is_good = measure(&plan)?;
        Ok(ExitCode::from(u8::from(!is_good)))
    })
}

/// Runs `what` is measured, with a new log, and returns what `read` finds in its lines.
///
/// # Errors
///
/// In words: it could not be run, has failed, or its lines are not as they should be; then the log
/// stays.
pub(super) fn judged<T>(
    what: impl Display,
    name: &str,
    run: impl FnOnce(&Path) -> Result<Outcome, String>,
    read: impl FnOnce(&Outcome) -> Result<T, String>,
) -> Result<T, String> {
    let log = system::new_log(name)?;
    let outcome = run(&log)?;
    let judgement = outcome.judge().map_err(|fault| fault.reason);
    let found = judgement.and_then(|()| read(&outcome));
    let found = found.map_err(|why| format!("{what} failed: {why}\n{}", outcome.tail()))?;
    // It is ours, and in the way of no one if it cannot be removed.
    let _ = fs::remove_file(&log);
    Ok(found)
}
