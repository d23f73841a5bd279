//! The commands of the tool as a person calls them: what they print, what they refuse, and their
//! exit codes. Nothing is booted.

mod dag_files;
mod files;
mod lines;
#[path = "../../src/record/tests/made.rs"]
#[allow(dead_code, reason = "each program uses a part of this")]
mod made;
mod recordings;
#[path = "../support/mod.rs"]
mod support;
mod traces;
