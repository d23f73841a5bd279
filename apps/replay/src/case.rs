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

use alloc::collections::BTreeMap;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;

use sched_dag::{Clusters, DagId, Instance, Policy, Preemption, TaskSet};

/// One set of DAGs with its expected schedule.
#[derive(Debug)]
pub struct Case {
    /// The case's name.
    pub name: String,
    /// Its records, from which it can be read again.
    pub text: String,
    /// The number of cores.
    pub cores: u32,
    /// How these are divided.
    pub clusters: Clusters,
    /// How ready instances are ordered.
    pub policy: Policy,
    /// Whether a started instance may lose its core.
    pub preemption: Preemption,
    /// The verified DAGs.
    pub task_set: Arc<TaskSet>,
    /// The execution times: of each DAG, for each subtask that of each job.
    pub executions_ns: Vec<Vec<Vec<u64>>>,
    /// The expected instances.
    pub instances: BTreeMap<Instance, InstanceTimes>,
    /// The expected jobs, by DAG and number.
    pub jobs: BTreeMap<(DagId, u64), JobTimes>,
}

/// What happened to an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InstanceTimes {
    /// When it first executed.
    pub start_ns: u64,
    /// When it had executed for its execution time.
    pub finish_ns: u64,
    /// How many dispatches took its core away.
    pub preemptions: u64,
}

/// What happened to a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
