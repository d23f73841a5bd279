//! The front: what an app sees and a person reads, on whatever platform the app runs.
//!
//! Lines, the words of the command line, reports and verdicts are the same on the bare machine
//! and on Linux, because they are made here, once. An app names `kernel`, never this.
//!
//! # Rooms, from top to bottom
//!
//! `shell` talks with a person during a run, `app` is the machine as an app sees it and judges
//! runs, `report` tells of a run when it is over, `options` reads the command line, `text` makes
//! lines. Where text goes is bound when a program is linked: its entry names its platform's
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

/// The modules that apps know by these names, with what is theirs in them.
pub mod named {
    /// Text on the serial line, or the standard output, which [`print!`](crate::print) and
    /// [`println!`](crate::println) write.
    pub mod console {
        #[doc(inline)]
        pub use crate::text::console::write;
    }

    /// The words of the command line.
    pub mod options {
        #[doc(inline)]
        pub use crate::options::{CommandLine, UsageError};
    }

    /// Machine lines: lines of JSON among the text, for programs that read it.
    pub mod json {
        #[doc(inline)]
        pub use crate::text::json::{JsonObject, emit, line, quoted};
    }
}
