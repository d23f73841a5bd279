//! What happened in a run: the times of every job and instance.
//!
//! A driver fills a [`Record`] while it runs a task set whose DAGs have a limit
//! of jobs; all its memory is taken before. Or it makes one afterwards from what
//! it has written down. Then [`violations`] holds the record against the model's
//! rules R1 to R4, [`dispatch_violations`] holds it together with the
//! [`Stretch`]es in which cores ran against R5, and reports compute their
//! figures from it. Times are in nanoseconds on the scheduler's clock.
//!
//! These two are the only checks of the rules after a run, in virtual time and
//! in the kernel. They are written from the rules alone and share no code with
//! the scheduler, so that an error there cannot hide here.

mod check;
mod dispatch;
mod violation;

use alloc::vec;
use alloc::vec::Vec;

pub use check::violations;
pub use dispatch::{Stretch, dispatch_violations};
pub use violation::{Rule, Violation};

use crate::ids::{CoreId, DagId, Instance, SubtaskId};
use crate::scheduler::JobOutcome;
use crate::task_set::TaskSet;

/// The times of one instance; each `None` until it has happened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InstanceRecord {
    /// When all that it waits for had happened.
    pub ready_ns: Option<u64>,
    /// When its function was called.
    pub start_ns: Option<u64>,
    /// When its function had returned.
    pub finish_ns: Option<u64>,
    /// When a fault had ended it instead; `None` also if that is not recorded.
    pub failed_ns: Option<u64>,
    /// The core on which it finished.
    pub core: Option<CoreId>,
    /// How many times its function has returned; more than 1 is a violation.
    pub runs: u32,
    /// How many times the scheduler has taken its core away.
    pub preemptions: u32,
}

/// The times of one job; each `None` until it has happened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JobRecord {
    /// The nominal release time, once the job is released.
    pub release_ns: Option<u64>,
    /// When the release was carried out.
    pub released_ns: Option<u64>,
    /// When it was cut, because it was aborted or its DAG was ended: from then
    /// on it starts no instance.
    pub cut_ns: Option<u64>,
    /// When its deadline was seen to have passed without it being complete.
    pub missed_ns: Option<u64>,
    /// When no instance of it was left.
    pub ended_ns: Option<u64>,
    /// How it ended; `None` if it was in flight at the end of the record.
    pub outcome: Option<JobOutcome>,
}

/// How exact the times of a record are, and so how strictly it is judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Precision {
    /// Everything has the very time at which the model lets it happen, as in
    /// virtual time: later is as wrong as earlier.
    Exact,
    /// Times were read from a clock by a machine that itself took time: what it
    /// has to wait for must have happened *before*, and how much before is its
    /// latency. Times read on different processors must be comparable.
    Measured,
}

/// The times of all jobs of all DAGs.
#[derive(Clone, Debug)]
pub struct Record {
    precision: Precision,
    dags: Vec<DagRecord>,
}

#[derive(Clone, Debug)]
struct DagRecord {
    subtasks: usize,
    jobs: Vec<JobRecord>,
    /// Job by job, within a job by subtask.
    instances: Vec<InstanceRecord>,
}

impl Record {
    /// Makes an empty record of measured times for all jobs of `task_set`. A DAG
    /// without a limit of jobs gets no room: nothing is recorded of it.
    ///
    /// Returns `None` if the jobs are too many for this machine's memory to
    /// address.
    #[must_use]
    pub fn new(task_set: &TaskSet) -> Option<Self> {
        let jobs = |dag| task_set.dag(dag).jobs().unwrap_or(0);
        Self::with_jobs(task_set, Precision::Measured, jobs)
    }

    /// Makes an empty record with room for the first `jobs(dag)` jobs of each
    /// DAG, for runs that end before the DAGs do.
    ///
    /// Returns `None` if the jobs are too many for this machine's memory to
    /// address.
    #[must_use]
    pub fn with_jobs(
        task_set: &TaskSet,
        precision: Precision,
        jobs: impl Fn(DagId) -> u64,
    ) -> Option<Self> {
        let dags = (0..).map(DagId).zip(task_set.dags()).map(|(id, dag)| {
            let jobs = usize::try_from(jobs(id)).ok()?;
            let subtasks = dag.subtasks().len();
            let instances = jobs.checked_mul(subtasks)?;
            Some(DagRecord {
                subtasks,
                jobs: vec![JobRecord::default(); jobs],
                instances: vec![InstanceRecord::default(); instances],
            })
        });
        Some(Self {
            precision,
            dags: dags.collect::<Option<_>>()?,
        })
    }

    /// Returns the bytes that a record for `task_set` needs, `None` if that is
    /// beyond a `usize`.
    #[must_use]
    pub fn size_of(task_set: &TaskSet) -> Option<usize> {
        task_set.dags().iter().try_fold(0usize, |sum, dag| {
            let jobs = usize::try_from(dag.jobs().unwrap_or(0)).ok()?;
            let job = size_of::<InstanceRecord>()
                .checked_mul(dag.subtasks().len())?
                .checked_add(size_of::<JobRecord>())?;
            sum.checked_add(jobs.checked_mul(job)?)
        })
    }

    /// Returns how exact the times are.
    #[must_use]
    pub const fn precision(&self) -> Precision {
        self.precision
    }

    /// Returns the jobs of a DAG.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[must_use]
    pub fn jobs(&self, dag: DagId) -> &[JobRecord] {
        &self.dags[dag.index()].jobs
    }

    /// Returns one job, `None` if it is not recorded.
    #[must_use]
    pub fn job(&self, dag: DagId, job: u64) -> Option<&JobRecord> {
        self.dags
            .get(dag.index())?
            .jobs
            .get(usize::try_from(job).ok()?)
    }

    /// Returns the instances of a job by subtask; empty if it is not recorded.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[must_use]
    pub fn instances(&self, dag: DagId, job: u64) -> &[InstanceRecord] {
        let dag = &self.dags[dag.index()];
        let range = usize::try_from(job).ok().and_then(|job| {
            let start = job.checked_mul(dag.subtasks)?;
            Some(start..start.checked_add(dag.subtasks)?)
        });
        range
            .and_then(|range| dag.instances.get(range))
            .unwrap_or(&[])
    }

    /// Returns an instance's times, `None` if it is not recorded.
    #[must_use]
    pub fn instance(&self, instance: Instance) -> Option<&InstanceRecord> {
        self.instances(instance.dag, instance.job)
            .get(instance.subtask.index())
    }

    /// Returns an instance's times to be filled in, `None` if it is not recorded.
    #[inline]
    pub fn instance_mut(&mut self, instance: Instance) -> Option<&mut InstanceRecord> {
        let dag = self.dags.get_mut(instance.dag.index())?;
        let job = usize::try_from(instance.job).ok()?;
        if job >= dag.jobs.len() || instance.subtask.index() >= dag.subtasks {
            return None;
        }
        dag.instances
            .get_mut(job * dag.subtasks + instance.subtask.index())
    }

    /// Returns a job's times to be filled in, `None` if it is not recorded.
    pub fn job_mut(&mut self, dag: DagId, job: u64) -> Option<&mut JobRecord> {
        self.dags
            .get_mut(dag.index())?
            .jobs
            .get_mut(usize::try_from(job).ok()?)
    }

    /// Returns when all predecessors of a subtask had finished their part of
    /// the job: the earliest time at which the model lets it become ready by R2.
    /// `None` if it has no predecessor, or one has not finished.
    #[must_use]
    pub fn join_ns(&self, task_set: &TaskSet, instance: Instance) -> Option<u64> {
        let Instance { dag, job, subtask } = instance;
        let job = self.instances(dag, job);
        let predecessors = task_set.dag(dag).predecessors(subtask);
        latest(predecessors.iter().map(|u| job.get(u.index())?.finish_ns))
    }

    /// Returns when a job was complete (R4): the latest finish of its subtasks.
    /// `None` if one has not finished.
    #[must_use]
    pub fn completion_ns(&self, dag: DagId, job: u64) -> Option<u64> {
        latest(
            self.instances(dag, job)
                .iter()
                .map(|instance| instance.finish_ns),
        )
    }

    /// Returns every recorded instance with its times: by DAG, job, subtask.
    pub fn all_instances<'a>(
        &'a self,
        task_set: &'a TaskSet,
    ) -> impl Iterator<Item = (Instance, &'a InstanceRecord)> {
        (0..)
            .map(DagId)
            .zip(task_set.dags())
            .flat_map(move |(dag, _)| {
                (0u64..).zip(self.jobs(dag)).flat_map(move |(job, _)| {
                    (0..)
                        .map(SubtaskId)
                        .zip(self.instances(dag, job))
                        .map(move |(subtask, record)| (Instance { dag, job, subtask }, record))
                })
            })
    }
}

/// Returns the latest of some times, `None` if one is missing or there are none.
fn latest(times: impl Iterator<Item = Option<u64>>) -> Option<u64> {
    times
        .reduce(|latest, time| Some(latest?.max(time?)))
        .flatten()
}
