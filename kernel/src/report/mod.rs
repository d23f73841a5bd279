//! What is told of a run when it is over: the [`Run`](crate::Run) that an app gets, its trace,
//! its statistics, and figures over many samples.
//!
//! All of it is computed from the journal, with the words of `text`. Nothing here is called
//! while a run goes on, but `latest` by a panic. What knows no machine is the front's.

pub(crate) mod latest;
pub(crate) mod left;
pub(crate) mod stacks;

pub(crate) use front::report::wire;
pub use front::report::{Distribution, Ns};
