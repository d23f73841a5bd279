//! A run as its trace describes it: the DAGs, the options, and what happened.
//!
//! Nothing is judged here. Times are nanoseconds since the run's epoch, the
//! instant from which the nominal release times O + kT count. Sums that leave
//! `u64` stay at its end, for a trace may state any number.
//!
//! *Events* are either of a job or of an instance; [`Word`] says which. Those
//! of the machine (`start` to `ended`) happened on the core that they name,
//! those of the scheduler in a step that was made on that core; only `request`
//! names another core, the one that shall switch.

use std::collections::BTreeMap;

use sched_dag::{CoreId, DagId, Instance, Policy, Preemption, SubtaskId};

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
    /// Events that were overwritten before they were printed.
    pub lost: u64,
    /// The same for each core, if the run says so.
    pub lost_by_core: Option<Vec<u64>>,
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

/// Something that happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    /// When.
    pub time_ns: u64,
    /// What.
    pub word: Word,
    /// Where; see [the module](self).
    pub core: CoreId,
    /// Of which DAG.
    pub dag: DagId,
    /// Of which job.
    pub job: u64,
    /// Of which subtask; `None` for the events of jobs.
    pub subtask: Option<SubtaskId>,
}

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Word {
    /// The job was released.
    Released,
    /// The job was due and had to wait for its release.
    Queued,
    /// The job was due and is never released.
    Skipped,
    /// The job starts no further instance.
    Aborted,
    /// The job's deadline passed before its completion.
    Missed,
    /// No instance of the job is left.
    Completed,
    /// The instance waits for nothing but a core.
    Ready,
    /// The instance will not run.
    Cancelled,
    /// The scheduler wants the core to run the instance instead of another.
    Request,
    /// The instance's function was called.
    Start,
    /// The instance lost its core.
    Suspend,
    /// The instance went on.
    Resume,
    /// The instance's function returned.
    Finish,
    /// The instance was ended by a fault, and its DAG with it.
    Ended,
    /// A signal came for the sporadic DAG's job.
    Signalled,
    /// A signal came while one was kept for the job, or no job was left.
    Dropped,
}

impl Word {
    /// All words as the trace spells them.
    pub const ALL: [(&str, Word); 16] = [
        ("released", Word::Released),
        ("queued", Word::Queued),
        ("skipped", Word::Skipped),
        ("aborted", Word::Aborted),
        ("missed", Word::Missed),
        ("completed", Word::Completed),
        ("ready", Word::Ready),
        ("cancelled", Word::Cancelled),
        ("request", Word::Request),
        ("start", Word::Start),
        ("suspend", Word::Suspend),
        ("resume", Word::Resume),
        ("finish", Word::Finish),
        ("ended", Word::Ended),
        ("signalled", Word::Signalled),
        ("dropped", Word::Dropped),
    ];

    /// Finds a word by its spelling.
    #[must_use]
    pub fn from_text(text: &str) -> Option<Word> {
        let known = Word::ALL.iter().find(|(spelling, _)| *spelling == text);
        known.map(|(_, word)| *word)
    }

    /// Returns the spelling.
    #[must_use]
    pub fn text(self) -> &'static str {
        let known = Word::ALL.iter().find(|(_, word)| *word == self);
        known.map_or("?", |(spelling, _)| spelling)
    }

    /// Reports whether it happens to a job, not to an instance.
    #[must_use]
    pub fn is_of_job(self) -> bool {
        use Word::{Aborted, Completed, Missed, Queued, Released, Skipped};
        let is_signal = matches!(self, Word::Signalled | Word::Dropped);
        is_signal
            || matches!(
                self,
                Released | Queued | Skipped | Aborted | Missed | Completed
            )
    }

    /// Reports whether it really happened on a core, beside the scheduler's
    /// books.
    #[must_use]
    pub fn is_of_machine(self) -> bool {
        use Word::{Ended, Finish, Resume, Start, Suspend};
        matches!(self, Start | Suspend | Resume | Finish | Ended)
    }
}

impl Event {
    /// Returns the instance, if the event is of one.
    #[must_use]
    pub fn instance(&self) -> Option<Instance> {
        let Self { dag, job, .. } = *self;
        self.subtask.map(|subtask| Instance { dag, job, subtask })
    }
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
