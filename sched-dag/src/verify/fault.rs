//! What makes a commit impossible, one variant a kind.
//!
//! A fault names everything that a message or a tool needs: the DAG, the
//! subtasks, the topic, the numbers. Its text (see [`Display`](core::fmt::Display))
//! states the fact, the offender and the remedy in one line; its
//! [`code`](Fault::code) never changes and is for machines.

use alloc::string::String;
use alloc::vec::Vec;

use super::label::{DagLabel, SubtaskLabel};
use crate::ids::ClusterId;

/// One reason why DAGs cannot be scheduled as described.
///
/// In every variant `dag` is the DAG and `subtask` the subtask at fault.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the fields' names are the words of the model")]
pub enum Fault {
    /// There is no DAG to schedule.
    NoDags,
    /// There is no core to schedule on.
    NoCores,
    /// A cluster of 0 cores.
    ClusterWithoutCores { cluster: ClusterId },
    /// The clusters have more cores than there are.
    ClustersBeyondCores { wanted: u64, cores: u32 },
    /// The cores are divided, and a DAG states no cluster.
    NoCluster { dag: DagLabel, clusters: usize },
    /// There is no such cluster. If the cores are not divided, there are 0.
    UnknownCluster {
        dag: DagLabel,
        cluster: ClusterId,
        clusters: usize,
    },
    /// More DAGs than a `u32` counts.
    TooManyDags { count: usize },
    /// A DAG without subtasks.
    NoSubtasks { dag: DagLabel },
    /// More subtasks than a `u32` counts.
    TooManySubtasks { dag: DagLabel, count: usize },
    /// The jobs in flight of all DAGs have more instances than the options
    /// allow; `dag` is the one that has most.
    TooManyInstances {
        dag: DagLabel,
        in_flight: u64,
        instances: u128,
        limit: u32,
    },
    /// Two subtasks of a DAG with one name.
    DuplicateSubtask {
        dag: DagLabel,
        first: SubtaskLabel,
        second: SubtaskLabel,
    },
    /// A cycle of two or more subtasks, from the smallest index on; the last
    /// one precedes the first.
    Cycle {
        dag: DagLabel,
        hops: Vec<SubtaskLabel>,
    },
    /// A subtask that precedes itself, by a topic or by an edge without one.
    SelfEdge {
        dag: DagLabel,
        subtask: SubtaskLabel,
        topic: Option<String>,
    },
    /// An edge to or from a subtask that does not exist.
    EdgeOutOfRange {
        dag: DagLabel,
        edge: (usize, usize),
        subtasks: usize,
    },
    /// Two parts of a DAG without any edge between them.
    NotConnected {
        dag: DagLabel,
        parts: usize,
        one: SubtaskLabel,
        other: SubtaskLabel,
    },
    /// Every subtask has a predecessor or an input.
    NoSource { dag: DagLabel },
    /// Several subtasks without predecessor where the policy wants one.
    SeveralSources {
        dag: DagLabel,
        sources: Vec<SubtaskLabel>,
    },
    /// Every subtask has a successor.
    NoSink { dag: DagLabel },
    /// Several subtasks without successor where the policy wants one.
    SeveralSinks {
        dag: DagLabel,
        sinks: Vec<SubtaskLabel>,
    },
    /// A topic that is written and never read.
    UnreadTopic {
        dag: DagLabel,
        topic: String,
        writer: SubtaskLabel,
        /// The topic that was probably meant.
        meant: Option<String>,
    },
    /// A topic that is read and never written.
    UnwrittenTopic {
        dag: DagLabel,
        topic: String,
        reader: SubtaskLabel,
        /// The topic that was probably meant.
        meant: Option<String>,
    },
    /// A reader that expects another type than the writer writes.
    TypeMismatch {
        dag: DagLabel,
        topic: String,
        writer: SubtaskLabel,
        written: &'static str,
        reader: SubtaskLabel,
        read: &'static str,
    },
    /// Several writers of one topic where the policy wants one.
    SeveralWriters {
        dag: DagLabel,
        topic: String,
        writers: Vec<SubtaskLabel>,
    },
    /// Several readers of a message that can only be moved.
    SeveralReaders {
        dag: DagLabel,
        topic: String,
        type_name: &'static str,
        readers: Vec<SubtaskLabel>,
    },
    /// One topic in several DAGs.
    TopicInSeveralDags { topic: String, dags: Vec<DagLabel> },
    /// One topic twice among the inputs or twice among the outputs of a subtask.
    DuplicateTopic {
        dag: DagLabel,
        subtask: SubtaskLabel,
        topic: String,
        direction: Direction,
    },
    /// More inputs or more outputs than [`MAX_ARITY`](crate::MAX_ARITY).
    ArityTooLarge {
        dag: DagLabel,
        subtask: SubtaskLabel,
        direction: Direction,
        arity: usize,
    },
    /// A DAG without period.
    MissingPeriod { dag: DagLabel },
    /// A period of 0.
    ZeroPeriod { dag: DagLabel },
    /// A DAG without relative deadline.
    MissingDeadline { dag: DagLabel },
    /// A relative deadline of 0.
    ZeroDeadline { dag: DagLabel },
    /// A sink with a relative deadline of 0.
    ZeroSinkDeadline { dag: DagLabel, sink: SubtaskLabel },
    /// A sink whose relative deadline is longer than its DAG's.
    SinkDeadlineBeyondDag {
        dag: DagLabel,
        sink: SubtaskLabel,
        relative_deadline_ns: u64,
        of_dag_ns: u64,
    },
    /// A subtask with a relative deadline and a successor.
    DeadlineOfNoSink {
        dag: DagLabel,
        subtask: SubtaskLabel,
        successor: SubtaskLabel,
    },
    /// A subtask that alone cannot meet the deadline.
    WcetExceedsDeadline {
        dag: DagLabel,
        subtask: SubtaskLabel,
        wcet_ns: u64,
        relative_deadline_ns: u64,
    },
    /// A stack that is too small or too large.
    StackOutOfRange {
        dag: DagLabel,
        subtask: SubtaskLabel,
        bytes: u64,
    },
    /// A DAG with a limit of 0 jobs.
    ZeroJobs { dag: DagLabel },
    /// A DAG with room for 0 jobs in flight.
    ZeroInFlight { dag: DagLabel },
    /// A DAG drops jobs at faults, at most 0 times.
    ZeroFaults { dag: DagLabel },
    /// A DAG survives faults within a window of 0 jobs.
    ZeroWindow { dag: DagLabel },
    /// A time that 64 bits of nanoseconds do not hold.
    TimeOverflow { dag: DagLabel, time: Time },
    /// Under static priority: some subtasks of a DAG have a priority, these not.
    PrioritiesPartlyGiven {
        dag: DagLabel,
        without: Vec<SubtaskLabel>,
    },
    /// Priorities were to be derived below those given elsewhere, and the
    /// numbers up to `u32::MAX` do not suffice.
    PrioritiesExhausted { dag: DagLabel },
    /// Two states of a DAG with one name.
    DuplicateState { dag: DagLabel, state: String },
    /// A state that no subtask uses.
    UnusedState { dag: DagLabel, state: String },
    /// A state that is read and never updated.
    StateNeverUpdated {
        dag: DagLabel,
        state: String,
        reader: SubtaskLabel,
    },
    /// A subtask that uses a state twice.
    StateUsedTwice {
        dag: DagLabel,
        state: String,
        subtask: SubtaskLabel,
    },
    /// Subtasks share a state, and several jobs may be in flight.
    StateOverJobs {
        dag: DagLabel,
        state: String,
        in_flight: u32,
        users: Vec<SubtaskLabel>,
    },
    /// The latest value of a topic that no subtask writes.
    LatestUnwritten {
        dag: DagLabel,
        topic: String,
        /// The topic that was probably meant.
        meant: Option<String>,
    },
    /// The latest value of a topic is read as another type than is written.
    LatestTypeMismatch {
        dag: DagLabel,
        topic: String,
        writer: SubtaskLabel,
        written: &'static str,
        read: &'static str,
    },
    /// The latest value of a topic, which no subtask reads.
    LatestUnread { dag: DagLabel, topic: String },
    /// The latest value of a message that can only be moved, with further readers.
    LatestOfMoved {
        dag: DagLabel,
        topic: String,
        type_name: &'static str,
        readers: usize,
    },
}

/// Which side of a subtask a topic stands on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Direction {
    /// The subtask reads the topic.
    Input,
    /// The subtask writes the topic.
    Output,
}

/// A time of a DAG that may overflow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Time {
    /// The absolute deadline of job 0.
    FirstDeadline,
    /// The absolute deadline of the last job.
    LastDeadline,
    /// The sum of the WCETs of all subtasks.
    Volume,
}

impl Fault {
    /// Returns the kind of fault as a stable word in snake case.
    #[must_use]
    pub const fn code(&self) -> &'static str {
        match self {
            Self::NoDags => "no_dags",
            Self::NoCores => "no_cores",
            Self::ClusterWithoutCores { .. } => "cluster_without_cores",
            Self::ClustersBeyondCores { .. } => "clusters_beyond_cores",
            Self::NoCluster { .. } => "no_cluster",
            Self::UnknownCluster { .. } => "unknown_cluster",
            Self::TooManyDags { .. } => "too_many_dags",
            Self::NoSubtasks { .. } => "no_subtasks",
            Self::TooManySubtasks { .. } => "too_many_subtasks",
            Self::TooManyInstances { .. } => "too_many_instances",
            Self::DuplicateSubtask { .. } => "duplicate_subtask",
            Self::Cycle { .. } => "cycle",
            Self::SelfEdge { .. } => "self_edge",
            Self::EdgeOutOfRange { .. } => "edge_out_of_range",
            Self::NotConnected { .. } => "not_connected",
            Self::NoSource { .. } => "no_source",
            Self::SeveralSources { .. } => "several_sources",
            Self::NoSink { .. } => "no_sink",
            Self::SeveralSinks { .. } => "several_sinks",
            Self::UnreadTopic { .. } => "unread_topic",
            Self::UnwrittenTopic { .. } => "unwritten_topic",
            Self::TypeMismatch { .. } => "type_mismatch",
            Self::SeveralWriters { .. } => "several_writers",
            Self::SeveralReaders { .. } => "several_readers",
            Self::TopicInSeveralDags { .. } => "topic_in_several_dags",
            Self::DuplicateTopic { .. } => "duplicate_topic",
            Self::ArityTooLarge { .. } => "arity_too_large",
            Self::MissingPeriod { .. } => "missing_period",
            Self::ZeroPeriod { .. } => "zero_period",
            Self::MissingDeadline { .. } => "missing_deadline",
            Self::ZeroDeadline { .. } => "zero_deadline",
            Self::ZeroSinkDeadline { .. } => "zero_sink_deadline",
            Self::SinkDeadlineBeyondDag { .. } => "sink_deadline_beyond_dag",
            Self::DeadlineOfNoSink { .. } => "deadline_of_no_sink",
            Self::WcetExceedsDeadline { .. } => "wcet_exceeds_deadline",
            Self::StackOutOfRange { .. } => "stack_out_of_range",
            Self::ZeroJobs { .. } => "zero_jobs",
            Self::ZeroInFlight { .. } => "zero_in_flight",
            Self::ZeroFaults { .. } => "zero_faults",
            Self::ZeroWindow { .. } => "zero_window",
            Self::TimeOverflow { .. } => "time_overflow",
            Self::PrioritiesPartlyGiven { .. } => "priorities_partly_given",
            Self::PrioritiesExhausted { .. } => "priorities_exhausted",
            Self::DuplicateState { .. } => "duplicate_state",
            Self::UnusedState { .. } => "unused_state",
            Self::StateNeverUpdated { .. } => "state_never_updated",
            Self::StateUsedTwice { .. } => "state_used_twice",
            Self::StateOverJobs { .. } => "state_over_jobs",
            Self::LatestUnwritten { .. } => "latest_unwritten",
            Self::LatestTypeMismatch { .. } => "latest_type_mismatch",
            Self::LatestUnread { .. } => "latest_unread",
            Self::LatestOfMoved { .. } => "latest_of_moved",
        }
    }
}
