//! A reference schedule: a set of DAGs, the execution time of every instance,
//! and the schedule that two independent implementations agree on.
//!
//! The records of such a file, blank-separated words, one record a line:
//!
//! ```text
//! case NAME m edf(0/1) preemptive(0/1) ndags
//! clusters m_0 m_1 ..           if the cores are divided; the sum is m
//! dag T D O K nsub nedge        then, if there are clusters: in C; then nsub lines:  sub wcet prio e_0 .. e_{K-1}
//!                               then nedge lines: edge u v
//! sink v D_v                    for sinks with a deadline of their own, D_v <= D
//! x dag job subtask start finish preemptions      (each instance once)
//! j dag job release finish response missed(0/1)   (each job once)
//! end
//! ```
//!
//! One unit of the file's time counts as a nanosecond here; the one that runs
//! a case chooses how long a unit is. WCETs play no part in a schedule; they are only
//! checked against the execution times.

use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;

use sched_dag::{Clusters, Policy, Preemption, TaskSet};

/// One set of DAGs with its expected schedule.
#[derive(Debug)]
pub struct Case {
    /// The case's name.
    pub name: String,
    /// The number of cores.
    pub cores: u32,
    /// How these are divided.
    pub clusters: Clusters,
    /// How ready instances are ordered.
    pub policy: Policy,
    /// Whether a started instance may lose its core.
    pub preemption: Preemption,
    /// What the case says about each DAG besides its graph.
    pub dags: Vec<CaseDag>,
    /// The verified DAGs.
    pub task_set: Arc<TaskSet>,
    /// The expected instances, in the order of [`CaseDag::position`].
    pub instances: Vec<InstanceTimes>,
    /// The expected jobs, for each DAG.
    pub jobs: Vec<Vec<JobTimes>>,
}

/// What a case says about one DAG besides its graph.
#[derive(Debug)]
pub struct CaseDag {
    /// The number of its jobs.
    pub jobs: usize,
    /// The number of its subtasks.
    pub subtasks: usize,
    /// The position of job 0's subtask 0 in a table of all instances.
    pub(crate) first_instance: usize,
    /// For each subtask the execution time of each job.
    pub executions_ns: Vec<Vec<u64>>,
}

/// What happened to an instance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InstanceTimes {
    /// When it first executed.
    pub start_ns: u64,
    /// When it had executed for its execution time.
    pub finish_ns: u64,
    /// How many dispatches took its core away.
    pub preemptions: u64,
}

/// What happened to a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JobTimes {
    /// When it was released.
    pub release_ns: u64,
    /// When it was complete.
    pub finish_ns: u64,
    /// The time between.
    pub response_ns: u64,
    /// Whether that is more than the relative deadline.
    pub missed: bool,
}

impl CaseDag {
    /// Returns an instance's position in a table of all instances: by DAG, then
    /// by job, then by subtask.
    #[must_use]
    pub fn position(&self, job: usize, subtask: usize) -> usize {
        self.first_instance + job * self.subtasks + subtask
    }
}
