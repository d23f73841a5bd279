//! Execution of jobs: from a release to a completion, only this module and the modules below run.
//!
//! `platform` takes an app's commit. `execution` holds the scheduler and makes each core follow the
//! scheduler's decisions; `worker` is each core's loop; `containment` ends a faulty instance.
//! `contexts` keeps stacks. `heartbeat` makes a core take interrupts now and then; `occupation`
//! occupies a core for an instance without real work. The crate's documentation shows the locks.

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
