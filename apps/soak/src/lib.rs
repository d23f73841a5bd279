//! A long run of random DAGs: nothing may break, leak or get lost.
//!
//! The run consists of *rounds*. Each draws a set of DAGs for a *load*, commits
//! it, and runs it for so long; then it checks that no rule of the task model is
//! broken, that every job is accounted for, that nothing was allocated while the
//! set ran, and that all memory and all stacks are there again.
//!
//! - [`draw_set`]: a random set for a load, the same for the same seed;
//! - [`Trouble`]: what befalls it, of faults, pauses and clusters;
//! - [`build`]: DAGs that execute for random times, and count what they did;
//! - [`Account`]: what became of all jobs, and what does not add up.
//!
//! The code here knows no kernel: the tests run it in virtual time.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod account;
mod dags;
mod graph;
mod set;
mod shares;
mod trouble;

pub use account::{Account, Discrepancy};
pub use dags::{Executed, build};
pub use set::{DagPlan, LEAST_PERCENT, MOST_OF_PERIOD, SubtaskPlan, draw_set, largest_set};
pub use trouble::{DagTrouble, FaultPlan, Then, Trouble};
