//! The commands of the tool as a person calls them: what they print, what they refuse, and their
//! exit codes. Nothing is booted.

mod dag_files;
mod files;
mod lines;
mod recordings;
#[path = "../support/mod.rs"]
mod support;
mod traces;
