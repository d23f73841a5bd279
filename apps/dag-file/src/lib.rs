//! DAGs that a file describes, run without a line of Rust.
//!
//! The host tool hands a [DAG file](fass_dag_file) to the kernel, having made it from another
//! format if need be. The app reads it, commits the DAGs and has every subtask execute for its
//! time:
//!
//! - [`build()`]: the DAGs as the app commits them.
//!
//! The code here knows no kernel: the tests run it in virtual time.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod build;
mod times;

pub use build::{RunSettings, build, commit};
