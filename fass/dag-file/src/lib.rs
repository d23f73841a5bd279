//! DAGs described by a file: reading such a file, writing it, and checking it.
//!
//! A *DAG file* is text: DAGs with their subtasks, edges and times, in one or more *sets*. The DAGs
//! of a set run together, the sets one after the other (`docs/dag-file.md`). The host tool and the
//! app `dag-file` read and check files with the same code.
//!
//! - [`DagFile`]: the contents of a file; its `Display` is a file again;
//! - [`parse()`]: reads a file, strictly;
//! - [`check()`]: finds the commit's refusals, with the lines at fault;
//! - [`Execution`], [`Length`]: how long instances execute, and the sets run.
//!
//! Readers of other formats also produce a [`DagFile`], with the line numbers of their own files.
//! So all formats share checks and messages.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod check;
mod execution;
mod file;
mod length;
mod parse;
pub mod time;
mod write;

pub use check::{check, verified};
pub use execution::{Execution, WHOLE, kernel_overheads_ns};
pub use file::{DagFile, FileDag, FileSubtask, Set, executed_ns, sample_len};
pub use length::Length;
pub use parse::{is_name, no_name, parse, refuse_repeated_edge};
