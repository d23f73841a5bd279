//! What is known of each instance and of each job after a run.

use std::ops::Deref;

use sched_dag::engine::Run;
use sched_dag::journal::Event;
use sched_dag::{DagId, Instance, law};

/// An instance that became ready, with its [times](law::InstanceRecord).
///
/// See [`Report`](crate::Report).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InstanceRecord {
    /// The instance.
    pub instance: Instance,
    /// How long it executes in all, in nanoseconds, once it has begun.
    pub execution_ns: u64,
    pub(crate) times: law::InstanceRecord,
}

/// A job that was released, with its [times](law::JobRecord).
///
/// See [`Report`](crate::Report).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JobRecord {
    /// The DAG.
    pub dag: DagId,
    /// The job.
    pub job: u64,
    /// The nominal release time, in nanoseconds, from which the deadline counts.
    pub release_ns: u64,
    /// The absolute deadline of the whole job, the latest one of its sinks'.
    pub deadline_ns: u64,
    pub(crate) times: law::JobRecord,
}

impl Deref for InstanceRecord {
    type Target = law::InstanceRecord;

    fn deref(&self) -> &law::InstanceRecord {
        &self.times
    }
}

impl Deref for JobRecord {
    type Target = law::JobRecord;

    fn deref(&self) -> &law::JobRecord {
        &self.times
    }
}

impl JobRecord {
    /// Takes the job of a release.
    pub(crate) fn new(run: &Run, release: &Event) -> Option<Self> {
        let Event { dag, job, .. } = *release;
        let times = *run.record().job(dag, job)?;
        let release_ns = times.release_ns.unwrap_or(release.time_ns);
        let deadline_ns = run.task_set().dag(dag).relative_deadline_ns();
        Some(Self {
            dag,
            job,
            release_ns,
            deadline_ns: release_ns.saturating_add(deadline_ns),
            times,
        })
    }

    /// Returns the time from the nominal release to the end, if there was one.
    ///
    /// See [`Report`](crate::Report).
    #[must_use]
    pub fn response_time_ns(&self) -> Option<u64> {
        self.ended_ns.map(|ended_ns| ended_ns - self.release_ns)
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
