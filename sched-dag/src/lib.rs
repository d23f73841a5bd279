//! The DAG task model, its verification at commit, and its scheduler.
//!
//! (Essay to be written by the crate's author: words, numbered rules R1-R5,
//! what is guaranteed and what is not.)
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod ids;
mod policy;
mod spec;
mod task_set;

pub use ids::{CoreId, DagId, Instance, SubtaskId};
pub use policy::{OverrunPolicy, Policy, Preemption, Priority};
pub use spec::{DagSpec, SubtaskSpec, TopicPort};
pub use task_set::{Dag, Subtask, TaskSet};
