//! What happened, one event at a time.
//!
//! Events stand in the order in which the scheduler let them happen. Their
//! times and their order are the same in every run, so a test may compare whole
//! sequences.

use sched_dag::{CoreId, DagId, Instance, JobOutcome};

/// Something that happened at an instant. See [`Report`](crate::Report), which has them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    /// When, in nanoseconds since the start of scheduling.
    pub time_ns: u64,
    /// What.
    pub kind: EventKind,
}

/// What happened.
///
/// ```
/// use virtual_time::{DagId, EventKind};
///
/// let event = EventKind::Released { dag: DagId(0), job: 3 };
/// assert_eq!(event.verb(), "release");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the fields' names are the words of the model")]
pub enum EventKind {
    /// A job was released.
    Released { dag: DagId, job: u64 },
    /// A release was due and waits for an older job to end.
    Queued { dag: DagId, job: u64 },
    /// A release did not happen.
    Skipped { dag: DagId, job: u64 },
    /// A sporadic DAG got a signal, for a job that is to be released at `release_ns`;
    /// `None`: the signal was dropped.
    Signalled { dag: DagId, release_ns: Option<u64> },
    /// All that an instance waits for has happened.
    Ready { instance: Instance },
    /// A core began an instance.
    Started { instance: Instance, core: CoreId },
    /// A core gave up an unfinished instance.
    Preempted { instance: Instance, core: CoreId },
    /// A core continued a preempted instance.
    Resumed { instance: Instance, core: CoreId },
    /// An instance finished.
    Finished { instance: Instance, core: CoreId },
    /// An instance has ended by a panic of its function.
    Failed { instance: Instance, core: CoreId },
    /// An instance will not run, because its job was aborted or its DAG ended.
    Cancelled { instance: Instance },
    /// A job starts no further instance.
    Aborted { dag: DagId, job: u64 },
    /// A DAG was ended by a panic; it starts no further instance.
    DagEnded { dag: DagId },
    /// A job's deadline passed before the job was complete.
    DeadlineMissed { dag: DagId, job: u64 },
    /// No instance of a job is left.
    JobCompleted {
        dag: DagId,
        job: u64,
        outcome: JobOutcome,
    },
}

impl EventKind {
    /// Returns a word for the kind of event.
    ///
    /// See [`EventKind`].
    #[must_use]
    pub const fn verb(&self) -> &'static str {
        match self {
            Self::Released { .. } => "release",
            Self::Queued { .. } => "queue",
            Self::Skipped { .. } => "skip",
            Self::Signalled { .. } => "signal",
            Self::Ready { .. } => "ready",
            Self::Started { .. } => "start",
            Self::Preempted { .. } => "preempt",
            Self::Resumed { .. } => "resume",
            Self::Finished { .. } => "finish",
            Self::Failed { .. } => "fail",
            Self::Cancelled { .. } => "cancel",
            Self::Aborted { .. } => "abort",
            Self::DagEnded { .. } => "end",
            Self::DeadlineMissed { .. } => "miss",
            Self::JobCompleted { .. } => "complete",
        }
    }
}
