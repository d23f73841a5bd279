//! Command lines of tests, and what they share with those of the views.

use std::ffi::OsString;

use tool::options::{Command, CommandLine};

#[path = "../../views/src/tests.rs"]
mod cells;

#[path = "../../views/src/record/tests/made.rs"]
#[allow(dead_code, reason = "each program uses a part of this")]
pub(crate) mod made;

pub(crate) use cells::{altered, rows};

/// Parses a command line that a table must accept.
pub(crate) fn right(table: &Command, line: &str) -> CommandLine {
    let words: Vec<_> = line.split_whitespace().map(OsString::from).collect();
    table.parse(&words).expect(line)
}
