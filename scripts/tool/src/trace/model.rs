//! A run as its trace describes it: the DAGs, the options, and what happened.
//!
//! Nothing is judged here. Times are nanoseconds since the run's epoch, the
//! instant from which the nominal release times O + kT count. Sums that leave
//! `u64` stay at its end, for a trace may state any number.
//!
//! *Events* are either of a job or of an instance; [`What`] says which. Those
//! of the machine (`start` to `ended`) happened on the core that they name,
//! those of the scheduler in a step that was made on that core; only `request`
//! names another core, the one that shall switch.

use std::collections::BTreeMap;

pub use sched_dag::journal::{Event, What};
use sched_dag::{DagId, Instance, Policy, Preemption, SubtaskId};

/// One run of one boot.
#[derive(Clone, Debug)]
pub struct Run {
    /// The run's number within its boot, counted from 0.
    pub number: u64,
    /// The line of the log where it begins, counted from 1.
    pub line: usize,
    /// How ready instances were ordered.
    pub policy: Policy,
    /// Whether a started instance could lose its core.
    pub preemption: Preemption,
    /// The cores that the scheduler served, at least 1.
    pub cores: u32,
    /// Whether the guest's time was counted, as it is in mode `deterministic`.
    pub is_counted: bool,
    /// The DAGs by number.
    pub dags: Vec<Dag>,
    /// What happened, in the order of the log.
    pub events: Vec<Event>,
    /// Events, the oldest ones, that had made way before they were printed.
    pub lost: u64,
    /// Whether the run says that it went on until every job had ended.
    pub complete: bool,
}

/// A DAG of a run.
#[derive(Clone, Debug)]
pub struct Dag {
    /// The name; may be empty.
    pub name: String,
    /// The period T.
    pub period_ns: u64,
    /// The relative deadline D.
    pub relative_deadline_ns: u64,
    /// The offset O.
    pub offset_ns: u64,
    /// Of a sporadic DAG, when its jobs were due; `None`: the grid says.
    pub sporadic: Option<Releases>,
    /// The subtasks by number.
    pub subtasks: Vec<Subtask>,
    /// For each subtask its direct predecessors, ascending.
    pub predecessors: Vec<Vec<SubtaskId>>,
}

/// The releases of a sporadic DAG's jobs.
#[derive(Clone, Debug, Default)]
pub struct Releases {
    /// The nominal release times by job; else when the scheduler first dealt with
    /// the job, which is a little later.
    pub times_ns: BTreeMap<u64, u64>,
    /// Whether the trace states the nominal ones.
    pub are_exact: bool,
}

/// A subtask of a DAG.
#[derive(Clone, Debug)]
pub struct Subtask {
    /// The name; may be empty.
    pub name: String,
    /// The static priority; the smaller number is the higher one.
    pub priority: u32,
    /// Whether a started instance keeps its core although preemption is on.
    pub non_preemptive: bool,
}

impl Run {
    /// Returns the nominal release time O + kT of a job, or that of a sporadic one;
    /// 0 if nothing is known of that.
    #[must_use]
    pub fn release_ns(&self, dag: DagId, job: u64) -> u64 {
        let dag = &self.dags[dag.index()];
        if let Some(releases) = &dag.sporadic {
            return releases.times_ns.get(&job).copied().unwrap_or(0);
        }
        dag.period_ns
            .saturating_mul(job)
            .saturating_add(dag.offset_ns)
    }

    /// Returns the absolute deadline O + kT + D of a job.
    #[must_use]
    pub fn deadline_ns(&self, dag: DagId, job: u64) -> u64 {
        let relative_ns = self.dags[dag.index()].relative_deadline_ns;
        self.release_ns(dag, job).saturating_add(relative_ns)
    }

    /// Reports whether a started instance keeps its core until it finishes.
    #[must_use]
    pub fn keeps_its_core(&self, instance: Instance) -> bool {
        let subtask = &self.dags[instance.dag.index()].subtasks[instance.subtask.index()];
        self.preemption == Preemption::Disabled || subtask.non_preemptive
    }

    /// Names a job for people.
    #[must_use]
    pub fn job_name(&self, dag: DagId, job: u64) -> String {
        match self.dags[dag.index()].name.as_str() {
            "" => format!("dag {} job {job}", dag.0),
            name => format!("dag `{name}` job {job}"),
        }
    }

    /// Names an instance for people.
    #[must_use]
    pub fn name(&self, instance: Instance) -> String {
        let Instance { dag, job, subtask } = instance;
        let of = self.job_name(dag, job);
        match self.dags[dag.index()].subtasks[subtask.index()]
            .name
            .as_str()
        {
            "" => format!("subtask {} of {of}", subtask.0),
            name => format!("subtask `{name}` of {of}"),
        }
    }

    /// Returns an instance's place in the order of dispatch (R5): the smaller
    /// one goes first. No two instances have the same.
    #[must_use]
    pub fn key(&self, instance: Instance) -> (u64, Instance) {
        let Instance { dag, job, subtask } = instance;
        let urgency = match self.policy {
            Policy::StaticPriority => {
                u64::from(self.dags[dag.index()].subtasks[subtask.index()].priority)
            }
            Policy::Edf => self.deadline_ns(dag, job),
        };
        (urgency, instance)
    }
}
