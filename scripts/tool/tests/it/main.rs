//! The commands of the tool as a person calls them: their output, their refusals, and their
//! exit codes; and schedules and traces held against references. Nothing is booted.

mod by_convert;
mod dag_files;
mod elf;
mod files;
mod in_chromium;
mod lines;
mod links;
#[path = "../../../views/src/record/tests/made.rs"]
#[allow(dead_code, reason = "each program uses a part of this")]
mod made;
mod on_host;
mod on_linux;
mod page;
mod proven;
mod recordings;
#[path = "../support/mod.rs"]
mod support;
#[path = "../support/tiny.rs"]
mod tiny;
mod traces;

/// The program that these tests call.
const PROGRAM: &str = env!("CARGO_BIN_EXE_fass-tool");
