//! The paper's workload in publish/subscribe form, to be compared with the DAG.
//!
//! One source, N parallel subtasks, one join, as in `fork-join`; but they are
//! callbacks that publish on topics, and the join is made by a synchronizer that
//! matches stamps. Each is a group of its own, so that different ones run side by
//! side and none overlaps with itself. Whatever is joined, parallel subtask b
//! executes its i-th job for the same time, which depends on the seed, b and i alone
//! ([`fork_join::ExecutionTimes`]).
//!
//! - [`Experiment`] says what to run and builds the graph of callbacks;
//! - [`Part`] is the callbacks of one group, and what they have seen;
//! - [`Samples`] are the times of a run, the same whatever joined.
//!
//! Nothing here knows the kernel: the tests run it on threads. How an execution
//! passes its time is given from outside.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod experiment;
mod part;
mod samples;

pub use experiment::{Experiment, Matching};
pub use part::{Message, Part};
pub use samples::{Joined, Samples, Span};
