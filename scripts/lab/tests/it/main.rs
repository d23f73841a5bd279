//! The laboratory's commands as a person calls them; schedules held against references. Nothing is
//! booted.

mod files;
mod lines;
mod on_linux;
mod oracle_schedules;
mod seams;
#[path = "../../../tool/tests/support/mod.rs"]
mod support;
#[path = "../../src/tests.rs"]
#[allow(dead_code, unused_imports, reason = "a part is used")]
mod tests;

/// The program that these tests call.
const PROGRAM: &str = env!("CARGO_BIN_EXE_fass-lab");
