//! The DAG task model, its verification at commit, and its scheduler.
//!
//! (Essay to be written by the crate's author: words, numbered rules R1-R5,
//! what is guaranteed and what is not.)
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

pub mod analysis;
mod ids;
mod policy;
mod priorities;
pub mod record;
mod scheduler;
mod spec;
mod task_set;
mod verify;
pub mod virtual_time;

pub use ids::{CoreId, DagId, Instance, SubtaskId};
pub use policy::{OverrunPolicy, Policy, Preemption, Priority};
pub use priorities::{longest_remaining_path_first, remaining_paths_ns};
pub use scheduler::{
    DagStatistics, Decision, JobOutcome, Moment, Observer, Released, Scheduler, SchedulerOptions,
};
pub use spec::{DagSpec, SubtaskSpec, TopicPort};
pub use task_set::{Dag, Subtask, TaskSet};
pub use verify::{
    CommitOptions, ConstructionPolicy, Count, DagLabel, Direction, Fault, MAX_ARITY, Rejected,
    SubtaskLabel, Time, Verified, Warning, verify,
};
