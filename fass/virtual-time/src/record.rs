//! What is known of each instance and of each job after a run.

use sched_dag::{CoreId, DagId, Instance, JobOutcome};

/// The times of one instance.
///
/// See [`Report`](crate::Report).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InstanceRecord {
    /// The instance.
    pub instance: Instance,
    /// When all that it waits for had happened.
    pub ready_ns: u64,
    /// When it began, if it did.
    pub start_ns: Option<u64>,
    /// When it finished, if it did.
    pub finish_ns: Option<u64>,
    /// When it ended by a panic of its function, if it did.
    pub failed_ns: Option<u64>,
    /// How long it executes in all, once it has begun.
    pub execution_ns: u64,
    /// The core on which it began.
    pub core: Option<CoreId>,
    /// How often it was preempted.
    pub preemptions: u32,
}

/// The times of one job that was released.
///
/// See [`Report`](crate::Report).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JobRecord {
    /// The DAG.
    pub dag: DagId,
    /// The job.
    pub job: u64,
    /// The nominal release time, from which the deadline counts.
    pub release_ns: u64,
    /// When the release took place; later than `release_ns` if it had to queue.
    pub released_at_ns: u64,
    /// The absolute deadline of the whole job, the latest one of its sinks'.
    pub deadline_ns: u64,
    /// When the job ended, if it did.
    pub finish_ns: Option<u64>,
    /// How the job ended, if it did.
    pub outcome: Option<JobOutcome>,
    /// Whether the deadline of a sink passed before that had finished.
    pub has_missed: bool,
}

impl JobRecord {
    /// Returns the time from the nominal release to the end, if there was one.
    ///
    /// See [`Report`](crate::Report).
    #[must_use]
    pub fn response_time_ns(&self) -> Option<u64> {
        self.finish_ns.map(|finish_ns| finish_ns - self.release_ns)
    }
}

/// A panic that was contained: it ended its DAG, and the run went on.
///
/// See [`contain_panics`](crate::VirtualTime::contain_panics).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PanicRecord {
    /// The instance whose function panicked.
    pub instance: Instance,
    /// The panic's message.
    pub message: String,
}
