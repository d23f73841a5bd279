//! Text on the standard output.
//!
//! Text and machine lines are told apart as on the machine: only `json` can print a line that
//! begins with `{`. Text is made before the output is locked, so what a value's `Display` does
//! is its own affair.

use std::fmt;
use std::io::{Write as _, stdout};
use std::sync::{Mutex, PoisonError};

/// Whether the output is at the begin of a line.
static BEGINS: Mutex<bool> = Mutex::new(true);

/// Writes text. A line that begins with `{` gets a blank before it.
pub fn write(text: fmt::Arguments<'_>) {
    let text = text.to_string();
    put(|begins| match begins && text.starts_with('{') {
        true => format!(" {text}").replace("\n{", "\n {"),
        false => text.replace("\n{", "\n {"),
    });
}

/// Writes a machine line and its end, on a line of its own.
pub fn write_line(_is_kernels: bool, line: &dyn fmt::Display) {
    let line = line.to_string().replace('\n', " ");
    put(|begins| match begins {
        true => format!("{line}\n"),
        false => format!("\n{line}\n"),
    });
}

/// Writes what is made of whether a line begins.
fn put(make: impl FnOnce(bool) -> String) {
    let mut begins = BEGINS.lock().unwrap_or_else(PoisonError::into_inner);
    let text = make(*begins);
    if let Some(last) = text.bytes().last() {
        *begins = last == b'\n';
    }
    let mut out = stdout().lock();
    // If nobody reads any more, nobody misses it.
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}

/// Prints text, formatted as by `std::print!`.
#[macro_export]
macro_rules! print {
    ($($argument:tt)*) => {
        $crate::console::write(::core::format_args!($($argument)*))
    };
}

/// Prints a line, formatted as by `std::println!`.
#[macro_export]
macro_rules! println {
    () => {
        $crate::print!("\n")
    };
    ($($argument:tt)*) => {
        $crate::print!("{}\n", ::core::format_args!($($argument)*))
    };
}
