//! What is told of a run when it is over: the [`Run`](crate::Run) that an app gets, its trace,
//! its statistics, and figures over many samples.
//!
//! All of it is computed from the journal, with the words of `text`. Nothing here is called
//! while a run goes on, but `latest` by a panic. `kernel/on-linux` compiles the files that know
//! no machine a second time.

pub(crate) mod counts;
mod distribution;
pub(crate) mod latest;
pub(crate) mod left;
pub(crate) mod stacks;
mod time;
pub(crate) mod times;
pub(crate) mod trace;
pub(crate) mod wire;

pub use distribution::Distribution;
pub use time::Ns;
