//! A job as a person looks at it: what each of its subtasks got and gave.

use std::fmt;

use recording::Role;
use sched_dag::{DagId, Instance, JobOutcome, SubtaskId};

use crate::edge::{Crossed, Divergence, Edge};
use crate::record::{InstanceRecord, JobRecord};
use crate::report::Report;

/// A job and all that is known of its subtasks. Shown, it is text with a line for each value.
///
/// See [`VirtualTime::until`](crate::VirtualTime::until).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JobShown {
    /// The name of the DAG.
    pub dag: String,
    /// The job.
    pub job: u64,
    /// Its times, if it was released.
    pub times: Option<JobRecord>,
    /// Its subtasks, in an order in which they may run.
    pub subtasks: Vec<SubtaskShown>,
    /// A fault that the job had in the recorded run, and has not had in this one.
    pub unmet_fault: Option<Divergence>,
}

/// What a subtask got and gave in a job.
///
/// See [`VirtualTime::until`](crate::VirtualTime::until).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SubtaskShown {
    /// Its name.
    pub name: String,
    /// Its times, if it became ready.
    pub times: Option<InstanceRecord>,
    /// The message of its panic, if it ended by one.
    pub panic: Option<String>,
    /// What it got: values of topics that it reads or samples, and times that it asked for.
    pub takes: Vec<Passed>,
    /// What it gave.
    pub gives: Vec<Passed>,
}

/// What passed between subtasks.
///
/// See [`VirtualTime::until`](crate::VirtualTime::until).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Passed {
    /// The topic; or `the time`, with all answers that it got.
    pub what: String,
    /// The value.
    pub value: Value,
}

/// A value, as far as it is known.
///
/// See [`VirtualTime::until`](crate::VirtualTime::until).
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Value {
    /// It is recorded: this is it, as JSON.
    Json(String),
    /// Its topic is not recorded, and is of this type.
    NotRecorded(&'static str),
    /// There is none: what writes it has not come to its end.
    None,
}

impl JobShown {
    pub(crate) fn new(report: &Report, edge: &Edge, dag: DagId, job: u64) -> Self {
        let model = report.task_set().dag(dag);
        let mut crossed = edge.crossed(dag, job);
        // Samples before times.
        crossed.sort_by_key(|crossed| crossed.role.is_none());
        let mut times = report.jobs.iter();
        let subtask = |subtask: &SubtaskId| {
            let instance = Instance {
                dag,
                subtask: *subtask,
                job,
            };
            let (mut panics, topics) = (report.panics.iter(), model.topics().iter());
            let panic = panics.find(|panic| panic.instance == instance);
            let value = |topic: &sched_dag::Topic| Passed {
                what: topic.name.clone(),
                value: value(edge, &crossed, dag, topic),
            };
            let reads = topics
                .clone()
                .filter(|topic| topic.readers.contains(subtask));
            let entered = crossed.iter().filter(|crossed| {
                crossed.subtask == *subtask && crossed.role.is_none_or(|role| !role.is_written())
            });
            let entered = entered.map(|crossed| Passed {
                what: crossed.topic.clone(),
                value: crossed.json.clone().map_or(Value::None, Value::Json),
            });
            SubtaskShown {
                name: model.subtask(*subtask).name().into(),
                times: report.instance(instance).copied(),
                panic: panic.map(|panic| panic.message.clone()),
                takes: reads.map(value).chain(entered).collect(),
                gives: topics
                    .filter(|topic| topic.writer == *subtask)
                    .map(value)
                    .collect(),
            }
        };
        Self {
            dag: model.name().into(),
            job,
            times: times
                .find(|times| times.dag == dag && times.job == job)
                .copied(),
            subtasks: model.topological_order().iter().map(subtask).collect(),
            unmet_fault: edge.unmet_fault(dag, job),
        }
    }
}

/// Returns the value of a topic of the DAG.
fn value(edge: &Edge, crossed: &[Crossed], dag: DagId, topic: &sched_dag::Topic) -> Value {
    let is_it = |crossed: &&Crossed| {
        crossed.role.is_some_and(Role::is_written) && crossed.topic == topic.name
    };
    match crossed.iter().find(is_it) {
        Some(crossed) => crossed.json.clone().map_or(Value::None, Value::Json),
        None if edge.records(dag, &topic.name) => Value::None,
        None => Value::NotRecorded(topic.type_name),
    }
}

impl fmt::Display for JobShown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { dag, job, .. } = self;
        let Some(times) = &self.times else {
            return write!(
                f,
                "job {job} of dag `{dag}` was not released: it was skipped, or the run is over"
            );
        };
        let outcome = match times.outcome {
            None => "not over",
            Some(JobOutcome::Met) => "in time",
            Some(JobOutcome::Missed) => "late",
            Some(JobOutcome::Aborted) => "aborted",
            Some(JobOutcome::Failed) => "cut by a fault",
            Some(JobOutcome::DagEnded) => "cut by the end of its dag",
        };
        let release_ns = times.release_ns;
        write!(
            f,
            "job {job} of dag `{dag}`, due at {release_ns} ns: {outcome}"
        )?;
        for subtask in &self.subtasks {
            write!(f, "\n{subtask}")?;
        }
        (self.unmet_fault.iter()).try_for_each(|fault| write!(f, "\n{fault}"))
    }
}

impl fmt::Display for SubtaskShown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ran = self
            .times
            .and_then(|times| Some((times.start_ns?, times.core?)));
        write!(f, "  `{}`", self.name)?;
        match ran {
            None => f.write_str(" did not run")?,
            Some((start_ns, core)) => write!(f, " from {start_ns} ns on core {}", core.0)?,
        }
        if let Some(panic) = &self.panic {
            write!(f, ", panicked: {panic}")?;
        }
        for (verb, all) in [("takes", &self.takes), ("gives", &self.gives)] {
            for Passed { what, value } in all {
                write!(f, "\n    {verb} `{what}`: {value}")?;
            }
        }
        Ok(())
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Json(json) => f.write_str(json),
            Self::NotRecorded(type_name) => {
                write!(f, "not recorded, a `{type_name}`; add `dag.record` for it")
            }
            Self::None => f.write_str("none"),
        }
    }
}
