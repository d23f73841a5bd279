//! The front: everything an app sees and a person reads, on whatever platform the app runs.
//!
//! Lines, command-line options, reports and verdicts are the same on the bare machine and on Linux,
//! because the code for them exists here, once. An app names `kernel`, never this crate.
//!
//! # Modules, from top to bottom
//!
//! `shell` talks with a person during a run, `app` is the app's view of the machine and judges
//! runs, `report` describes a finished run, `options` reads the command line, `text` makes lines.
//! The destination of text is bound at link time: a program's entry names its platform's output
//! function by [`output!`], once.
//!
//! # What is guaranteed
//!
//! - Only [`json`] can print a line that begins with `{`.
//! - Printing allocates nothing.
//!
//! # What is relied on
//!
//! - `fass` and `sched-dag` alone; nothing here knows a machine.

#![cfg_attr(not(test), no_std)]
#![allow(
    rustdoc::private_intra_doc_links,
    reason = "its readers have its source; what apps use is documented in `kernel`, too"
)]

extern crate alloc;

pub mod app;
pub mod options;
pub mod report;
pub mod shell;
pub mod text;

pub use text::{console, json};

/// The modules known to apps by these names, with the items meant for apps.
pub mod named {
    /// Text on the serial line, or the standard output, as written by [`print!`](crate::print) and
    /// [`println!`](crate::println).
    pub mod console {
        #[doc(inline)]
        pub use crate::text::console::write;
    }

    /// The options of the command line.
    pub mod options {
        #[doc(inline)]
        pub use crate::options::{CommandLine, UsageError};
    }

    /// Machine lines: lines of JSON among the text, for programs reading the output.
    pub mod json {
        #[doc(inline)]
        pub use crate::text::json::{JsonObject, emit, line, quoted};
    }
}
