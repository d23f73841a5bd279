//! What the tool prints, also where nobody reads it.
//!
//! The standard library's printing macros panic when a write fails, and a write fails
//! as soon as the reader of a pipe has left (`./scripts/oracle ... | head -1`). That no
//! one reads on is no failure: the work goes on, and its exit code says how it ended.
//! Any other reason why standard output takes nothing, such as a full disk, is one: it is
//! said at the end, by [`conclude`].
//!
//! So this library has macros of the same names, which hide those of the standard
//! library in all its modules; nobody has to think of it where something is printed.

/// Writes to standard output; as the standard library's, but it never panics.
#[macro_export]
macro_rules! print {
    ($($what:tt)*) => {
        $crate::output::put(::std::format_args!($($what)*))
    };
}

/// Writes a line to standard output; as the standard library's, but it never panics.
#[macro_export]
macro_rules! println {
    ($($what:tt)*) => {
        $crate::output::put(::std::format_args!("{}\n", ::std::format_args!($($what)*)))
    };
}

/// Writes to standard error; as the standard library's, but it never panics.
#[macro_export]
macro_rules! eprint {
    ($($what:tt)*) => {
        $crate::output::complain(::std::format_args!($($what)*))
    };
}

/// Writes a line to standard error; as the standard library's, but it never panics.
#[macro_export]
macro_rules! eprintln {
    ($($what:tt)*) => {
        $crate::output::complain(::std::format_args!("{}\n", ::std::format_args!($($what)*)))
    };
}

use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write, stderr, stdout};
use std::process::ExitCode;
use std::sync::OnceLock;

/// Why standard output did not take everything, if it did not.
static LOST: OnceLock<io::Error> = OnceLock::new();

/// Writes to standard output; for the macros.
pub fn put(what: Arguments<'_>) {
    note(stdout().write_fmt(what));
}

/// Writes to standard error; for the macros. That it cannot be written can be said nowhere.
pub fn complain(what: Arguments<'_>) {
    let _ = stderr().write_fmt(what);
}

fn note(written: io::Result<()>) {
    if let Err(error) = written
        && error.kind() != ErrorKind::BrokenPipe
    {
        // The first reason is the one that is said.
        let _ = LOST.set(error);
    }
}

/// Returns the exit code of the tool, whose work has ended with `code`: a failure, which
/// is said here, if not all output could be written.
#[must_use]
pub fn conclude(code: ExitCode) -> ExitCode {
    note(stdout().flush());
    let Some(error) = LOST.get() else {
        return code;
    };
    eprintln!("fass-tool: standard output could not be written: {error}");
    if code == ExitCode::SUCCESS {
        return ExitCode::FAILURE;
    }
    code
}
