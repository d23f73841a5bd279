//! DAGs that a file describes, run without a line of Rust.
//!
//! A *DAG file* is text: DAGs with their subtasks, edges and times, in one or
//! more *sets*; the DAGs of a set run together, the sets one after the other
//! (`docs/dag-file.md`). The host tool hands such a file to the kernel, having
//! made it from another format if need be, and the app reads it, commits the DAGs
//! and has every subtask execute for its time.
//!
//! - [`DagFile`]: what a file says; its `Display` is a file again;
//! - [`parse()`]: reading it, strictly;
//! - [`check()`]: what the commit would refuse, with the lines at fault;
//! - [`Execution`]: how long each instance executes;
//! - [`build()`]: the DAGs as the app commits them.
//!
//! A reader of another format makes a [`DagFile`] of it, too, with the line
//! numbers of *that* file, and so all formats share checks and messages.
//!
//! The code here knows no kernel: the tests run it in virtual time.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod build;
mod check;
mod execution;
mod file;
mod parse;
pub mod time;
mod write;

pub use build::{Length, Settings, build};
pub use check::check;
pub use execution::Execution;
pub use file::{DagFile, FileDag, FileSubtask, Set};
pub use parse::{is_name, no_name, parse, refuse_repeated_edge};
pub use replay::lines::{Malformed, quoted};
pub use replay::repeated;
