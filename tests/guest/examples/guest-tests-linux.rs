//! The suite of scenarios as a program for Linux, for a mechanism that only a guest has.

extern crate alloc;
extern crate kernel_on_linux as kernel;

use std::process::ExitCode;

#[path = "../src/scenarios.rs"]
mod suite;

kernel::entry!(suite::run);

fn main() -> ExitCode {
    program()
}
