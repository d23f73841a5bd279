//! Texts of a file or of a person: read with the places of their words, and shown visibly.
//!
//! - [`Lines`]: words and numbers of a file, with line numbers;
//! - [`quoted`], [`visible`]: words of a file, or of a person, in messages;
//! - [`of_file`]: faults for which a commit would refuse the DAGs, in the words of a file;
//! - [`repeated`]: items that appear twice.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod lines;
mod shown;

pub use lines::{Line, Lines, MOST_CORES, Malformed, blocks, cases, of_file, repeated};
pub use shown::{is_seen, quoted, shown, visible};
