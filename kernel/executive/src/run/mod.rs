//! Execution of jobs: from a release to a completion, no code runs but this module and those below.
//!
//! `platform` takes what an app commits. `execution` holds the scheduler and brings each core
//! to what it decides, `worker` is each core's loop, `containment` ends what is at fault.
//! `contexts` keeps stacks. `heartbeat` has a core take interrupts now and then; `occupation`
//! holds a core for an instance that only stands for work.

pub mod containment;
pub mod contexts;
pub mod edge;
pub mod execution;
pub mod heartbeat;
pub(crate) mod occupation;
pub mod platform;
pub mod record;
pub mod stacks;
pub mod worker;
