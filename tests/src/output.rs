//! What the tool prints, also where nobody reads it.
//!
//! The standard library's printing macros panic when a write fails, and a write fails
//! as soon as the reader of a pipe has left (`./scripts/oracle ... | head -1`). That no
//! one reads on is no failure: the work goes on, and its exit code says how it ended.
//!
//! So this library has macros of the same names, which hide those of the standard
//! library in all its modules; nobody has to think of it where something is printed.

/// Writes to standard output; as the standard library's, but it never panics.
#[macro_export]
macro_rules! print {
    ($($what:tt)*) => {
        $crate::output::put(&mut ::std::io::stdout(), ::std::format_args!($($what)*))
    };
}

/// Writes a line to standard output; as the standard library's, but it never panics.
#[macro_export]
macro_rules! println {
    ($($what:tt)*) => {
        $crate::output::put_line(&mut ::std::io::stdout(), ::std::format_args!($($what)*))
    };
}

/// Writes to standard error; as the standard library's, but it never panics.
#[macro_export]
macro_rules! eprint {
    ($($what:tt)*) => {
        $crate::output::put(&mut ::std::io::stderr(), ::std::format_args!($($what)*))
    };
}

/// Writes a line to standard error; as the standard library's, but it never panics.
#[macro_export]
macro_rules! eprintln {
    ($($what:tt)*) => {
        $crate::output::put_line(&mut ::std::io::stderr(), ::std::format_args!($($what)*))
    };
}

use std::fmt::Arguments;
use std::io::Write;

/// Writes what a macro was given; that it cannot be written is not said.
pub fn put(stream: &mut impl Write, what: Arguments<'_>) {
    let _ = stream.write_fmt(what);
}

/// Works like [`put`] and ends the line.
pub fn put_line(stream: &mut impl Write, what: Arguments<'_>) {
    let _ = stream.write_fmt(format_args!("{what}\n"));
}
