//! The way of text to the platform's output.
//!
//! Text and machine lines are told apart: only [`json`](super::json) can print a line that begins
//! with `{`. What is printed goes to the function of the platform that the program's entry names
//! by [`output!`](crate::output). It is found when the program is linked: a pointer to it would cost
//! each image bytes, and each line a look.

mod piece;

use core::fmt;

pub use piece::{Kind, LONGEST, Pieces};

#[allow(unsafe_code, reason = "one symbol, which another crate defines")]
mod bound {
    use core::fmt;

    use super::Kind;

    // SAFETY: `output!` alone defines the symbol, as a safe function of this very type; the linker
    // refuses a program that has none or two.
    unsafe extern "Rust" {
        pub(super) safe fn front_output(kind: Kind, text: fmt::Arguments<'_>);
    }
}

/// Makes a function of the platform's, `fn(Kind, fmt::Arguments<'_>)`, the one that all text of
/// the program goes to. To be called once in a program.
#[macro_export]
macro_rules! output {
    ($write:path) => {
        #[unsafe(no_mangle)]
        fn front_output(kind: $crate::console::Kind, text: ::core::fmt::Arguments<'_>) {
            $write(kind, text);
        }
    };
}

/// Writes text. What one call writes stays together, up to 1 KiB of it. A line that begins with
/// `{` gets a blank before it. For [`print!`](crate::print).
///
/// ```no_run
/// kernel::println!("{} jobs", 3); // calls it
/// ```
pub fn write(text: fmt::Arguments<'_>) {
    bound::front_output(Kind::Text, text);
}

/// Writes a machine line and its end, on a line of its own.
pub(super) fn write_line(kind: Kind, line: &dyn fmt::Display) {
    bound::front_output(kind, format_args!("{line}"));
}

/// Prints text: on the serial line of the machine, on the standard output of Linux.
///
/// What is printed is made into text by the caller's context, so a `Display` that
/// panics or takes long is the caller's own affair.
#[macro_export]
macro_rules! print {
    ($($text:tt)*) => { $crate::console::write(::core::format_args!($($text)*)) };
}

/// Prints a line of text, as [`print!`](crate::print) does.
#[macro_export]
macro_rules! println {
    () => { $crate::print!("\n") };
    ($($text:tt)*) => { $crate::print!("{}\n", ::core::format_args!($($text)*)) };
}

#[cfg(test)]
#[allow(unsafe_code, reason = "the symbol, for a program of tests")]
mod tests {
    crate::output!(forget);

    fn forget(_: super::Kind, _: core::fmt::Arguments<'_>) {}
}
