//! The commands of the laboratory that boot guests.

mod chooses_mode;
mod soak;
#[path = "../../../tool/tests/support/mod.rs"]
mod support;

/// The program that these tests call.
const PROGRAM: &str = env!("CARGO_BIN_EXE_fass-lab");
