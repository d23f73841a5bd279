//! What is told of a run when it is over: its trace, its statistics, and figures over many
//! samples. All of it is computed from the journal.

pub mod counts;
pub mod crossing;
pub mod memory;
mod time;
pub mod times;
pub mod trace;
pub mod wire;

pub use sched_dag::law::Distribution;
pub use time::Ns;
