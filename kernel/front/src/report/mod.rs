//! The report of a run that is over: what became of its jobs, its memory, its wires and its
//! recording, and how times are written; and what its functions say meanwhile.

pub mod counts;
pub mod crossing;
pub mod log;
pub mod memory;
pub mod record;
mod time;
pub mod wire;

pub use sched_dag::law::Distribution;
pub use time::Ns;
