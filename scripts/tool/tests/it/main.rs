//! The commands of the tool as a person calls them: their output, their refusals, and their
//! exit codes; and schedules and traces held against references. Nothing is booted.

mod dag_files;
mod files;
mod lies;
mod lines;
#[path = "../../src/record/tests/made.rs"]
#[allow(dead_code, reason = "each program uses a part of this")]
mod made;
mod on_linux;
mod oracle_schedules;
mod published_schedules;
mod recordings;
#[path = "../../../../sched-dag/tests/it/support/mod.rs"]
mod sets;
#[path = "../support.rs"]
mod support;
mod trace_of_virtual_time;
mod traces;
