//! What is told of a run: its trace, its statistics, and figures over many samples.

mod distribution;
mod time;
pub(crate) mod times;
pub(crate) mod trace;

pub use distribution::Distribution;
pub use time::Ns;
