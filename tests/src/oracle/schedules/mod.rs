//! Reference schedules: what runs when, to the unit.
//!
//! A case is a set of DAGs with the execution time of every instance, and the
//! schedule that two independent implementations agree on. [`check`] commits
//! the DAGs, replays them through the real scheduler in virtual time, and
//! compares each start, finish and number of preemptions, and of each job
//! release, finish, response time and miss. The records of `schedules.txt`:
//!
//! ```text
//! case NAME m edf(0/1) preemptive(0/1) ndags
//! dag T D O K nsub nedge        then nsub lines:  sub wcet prio e_0 .. e_{K-1}
//!                               then nedge lines: edge u v
//! x dag job subtask start finish preemptions      (each instance once)
//! j dag job release finish response missed(0/1)   (each job once)
//! end
//! ```
//!
//! One unit of the file's time is a nanosecond here. WCETs play no part in a
//! schedule; they are only checked against the execution times.

mod parse;
mod replay;

pub use parse::parse;
pub use replay::check;

use sched_dag::{Policy, Preemption, TaskSet};
use std::sync::Arc;

/// One set of DAGs with its expected schedule.
#[derive(Debug)]
pub struct Case {
    /// The case's name.
    pub name: String,
    cores: u32,
    policy: Policy,
    preemption: Preemption,
    dags: Vec<CaseDag>,
    task_set: Arc<TaskSet>,
    /// The expected instances, as `Table` orders them.
    instances: Vec<InstanceTimes>,
    /// The expected jobs, for each DAG.
    jobs: Vec<Vec<JobTimes>>,
}

/// What a case says about one DAG beside its graph.
#[derive(Debug)]
struct CaseDag {
    jobs: usize,
    subtasks: usize,
    /// The position of job 0's subtask 0 in a table of all instances.
    first_instance: usize,
    /// For each subtask the execution time of each job.
    executions_ns: Vec<Vec<u64>>,
}

/// What happened to an instance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct InstanceTimes {
    start_ns: u64,
    finish_ns: u64,
    preemptions: u64,
}

/// What happened to a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct JobTimes {
    release_ns: u64,
    finish_ns: u64,
    response_ns: u64,
    missed: bool,
}

impl CaseDag {
    /// Returns an instance's position in a table of all instances.
    fn position(&self, job: usize, subtask: usize) -> usize {
        self.first_instance + job * self.subtasks + subtask
    }
}
