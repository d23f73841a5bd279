//! What is told of a run when it is over: its trace, its statistics, and figures over many
//! samples, all of it computed from the journal; and what its functions say meanwhile.

pub mod counts;
pub mod crossing;
mod distribution;
pub mod log;
pub mod memory;
mod time;
pub mod times;
pub mod trace;
pub mod wire;

pub use distribution::Distribution;
pub use time::Ns;
