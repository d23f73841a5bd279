//! DAGs described by a file, run without a line of Rust.
//!
//! The host tool hands a [DAG file](fass_dag_file) to the kernel, converted from another format if
//! need be. The app reads the file, commits the DAGs, and lets every subtask execute for its time:
//!
//! - [`build()`]: the DAGs as the app commits them.
//!
//! The library does not use the kernel: the tests run the DAGs in virtual time.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod build;
mod times;

pub use build::{RunSettings, build, commit};
