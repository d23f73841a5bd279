//! A job as a person looks at it: the inputs and outputs of each of its subtasks.

use std::fmt;

use recording::{Channel, Entry, EntryKind, Recordable, Recording, Shown};
use sched_dag::{DagId, Instance, JobOutcome, SubtaskId, Topic};

use crate::edge::Divergence;
use crate::report::Report;
use crate::report::{InstanceRecord, JobRecord};

/// A job and all known data of its subtasks. Displayed as text with a line for each value.
///
/// See [`VirtualTime::until`](crate::VirtualTime::until).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JobShown {
    /// The name of the DAG.
    pub dag: String,
    /// The job.
    pub job: u64,
    /// The job's times, if the job was released.
    pub times: Option<JobRecord>,
    /// The subtasks, in a possible order of execution.
    pub subtasks: Vec<SubtaskShown>,
    /// A fault of the job in the recorded run, missing in this run.
    pub unmet_fault: Option<Divergence>,
}

/// The inputs and outputs of a subtask in a job.
///
/// See [`VirtualTime::until`](crate::VirtualTime::until).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SubtaskShown {
    /// The subtask's name.
    pub name: String,
    /// The times of the instance, if it became ready.
    pub times: Option<InstanceRecord>,
    /// The message of a panic that ended the instance.
    pub panic: Option<String>,
    /// The inputs: values read or sampled from topics, recorded states, answers of devices, and
    /// clock readings.
    pub takes: Vec<Passed>,
    /// The outputs.
    pub gives: Vec<Passed>,
}

/// A value that a subtask took or gave.
///
/// See [`VirtualTime::until`](crate::VirtualTime::until).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Passed {
    /// The topic, the state or the device; or `the time`, for all clock readings of the subtask.
    pub what: String,
    /// The value.
    pub value: Value,
}

/// A value, as far as it is known.
///
/// See [`VirtualTime::until`](crate::VirtualTime::until).
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Value {
    /// The recorded value, as JSON.
    Json(String),
    /// A value of this type, on a topic that is not recorded.
    NotRecorded(&'static str),
    /// No value: the writer was cut or has not come to its end, or the recording has lost the
    /// value.
    None,
}

impl JobShown {
    /// Shows a job of a run. The recording so far supplies the known values.
    #[allow(clippy::too_many_lines, reason = "all that is known of one job")]
    pub(crate) fn new(report: &Report, recording: &[u8], dag: DagId, job: u64) -> Self {
        let recording = Recording::read(recording).expect("it is what this machine has written");
        let channels = &recording.header().channels;
        let times = Vec::<u64>::schema();
        // The entries passed on a channel; or, without a channel, the times told to the subtask.
        let passed = |entry: Entry<'_>| {
            let is_of_job = (u32::from(entry.dag), entry.job) == (dag.0, job);
            let channel = match entry.what {
                EntryKind::Value | EntryKind::Lost if is_of_job => {
                    Some(&channels[usize::from(entry.place)])
                }
                EntryKind::Clock if is_of_job => None,
                _ => return None,
            };
            // Without a channel, the place of an entry is the number of the subtask.
            let subtask = channel.map_or(entry.place, |channel| channel.subtask);
            let (schema, bytes) = (channel.map_or(&times, |it| &it.schema), entry.value);
            let value = match entry.what {
                EntryKind::Lost => Value::None,
                _ => Value::Json(Shown { schema, bytes }.to_string()),
            };
            Some((channel, SubtaskId(subtask.into()), value))
        };
        let mut crossed: Vec<_> = recording.entries().filter_map(passed).collect();
        // Samples before times.
        crossed.sort_by_key(|(channel, ..)| channel.is_none());
        let on_topic = |topic: &Topic| {
            let is_it = |channel: &Channel| {
                let is_of = channel.role.is_written() && u32::from(channel.dag) == dag.0;
                is_of && channel.topic == topic.name
            };
            let mut crossed = crossed.iter();
            let value = match crossed.find(|(channel, ..)| channel.is_some_and(is_it)) {
                Some((.., value)) => value.clone(),
                // Recorded, but not in this job: the writer was cut, or is not complete yet.
                None if channels.iter().any(is_it) => Value::None,
                None => Value::NotRecorded(topic.type_name),
            };
            let what = topic.name.clone();
            Passed { what, value }
        };
        let model = report.task_set().dag(dag);
        let subtask = |subtask: SubtaskId| {
            let instance = Instance { dag, subtask, job };
            let (mut panics, topics) = (report.panics.iter(), model.topics().iter());
            let panic = panics.find(|panic| panic.instance == instance);
            let reads = (topics.clone()).filter(|topic| topic.readers.contains(&subtask));
            let entered = crossed.iter().filter(|(channel, of, _)| {
                *of == subtask && channel.is_none_or(|channel| !channel.role.is_written())
            });
            let entered = entered.map(|(channel, _, value)| Passed {
                what: channel.map_or("the time", |channel| &channel.topic).into(),
                value: value.clone(),
            });
            let writes = topics.filter(|topic| topic.writer == subtask);
            SubtaskShown {
                name: model.subtask(subtask).name().into(),
                times: report.instance(instance).copied(),
                panic: panic.map(|panic| panic.message.clone()),
                takes: reads.map(on_topic).chain(entered).collect(),
                gives: writes.map(on_topic).collect(),
            }
        };
        let mut times = report.jobs.iter();
        let order = model.topological_order().iter().copied();
        Self {
            dag: model.name().into(),
            job,
            times: times.find(|of| (of.dag, of.job) == (dag, job)).copied(),
            subtasks: order.map(subtask).collect(),
            unmet_fault: None,
        }
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
        let release_ns = times.release_ns.unwrap_or_default();
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
