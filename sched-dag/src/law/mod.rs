//! The law: what follows from a run's journal.
//!
//! All of it is computed from the [events](crate::journal) that a driver has written
//! down:
//!
//! - [`violations`]: every breach of the model's rules R1 to R4, and of what every
//!   machine must keep: one life of each instance, one instance on each core;
//! - [`dispatch_violations`]: every breach of R5 and of T1 to T4; [`sweep`] is its core;
//! - [`MeasuredCosts`]: what the platform's own work has taken;
//! - [`RunRecord::of_events`]: the times of every job and instance, of the latest whole
//!   jobs if the oldest events are lost;
//! - [`RunTally`]: statistics of a run of any length, in a fixed amount of memory, each of
//!   which is read as a [`Distribution`].
//!
//! How strictly a journal is judged is said by [`JudgeOptions`]. Times are in nanoseconds from
//! the run's epoch.
//!
//! These are the only checks of the rules after a run: in virtual time, on threads, in
//! the kernel, and of a trace that is read from a file. They are written from the rules
//! alone and share no code with the scheduler, so that an error there cannot hide here.
//! They do not find what leaves no event: that values went astray, or that a rule was
//! broken before the events that are left.

mod costs;
mod dispatch;
mod distribution;
mod facts;
mod replay;
pub mod sweep;
mod tables;
mod tally;
mod violation;

use alloc::vec::Vec;
use core::ops::Range;

pub use costs::MeasuredCosts;
pub use dispatch::{DispatchReport, dispatch_violations, judge_dispatch};
pub use distribution::{Distribution, Histogram};
pub use replay::{ReplayVerdict, judge, violations};
pub use tally::{DagTally, RunTally, SubtaskTally};
pub use violation::{Rule, Violation};

use crate::ids::{CoreId, DagId, Instance, SubtaskId};
use crate::policy::JobOutcome;
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
    /// When it was cut, because it was aborted, had a fault, or its DAG was ended: from
    /// then on it starts no instance.
    pub cut_ns: Option<u64>,
    /// Whether a fault has cut it while its DAG went on.
    pub has_failed: bool,
    /// When its deadline was seen to have passed without it being complete.
    pub missed_ns: Option<u64>,
    /// When no instance of it was left.
    pub ended_ns: Option<u64>,
    /// How it ended; `None` if it was in flight at the end of the record.
    pub outcome: Option<JobOutcome>,
}

impl JobRecord {
    /// Returns the time from the nominal release to the end, if there was one.
    pub fn response_time_ns(&self) -> Option<u64> {
        Some(self.ended_ns?.saturating_sub(self.release_ns?))
    }
}

/// Options of the judge: whether a journal is whole and complete, and the tolerance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JudgeOptions {
    /// Whether no event is missing. Else the oldest ones are, and of what they may have
    /// been about, nothing is concluded from an event that is not there.
    pub is_whole: bool,
    /// Whether the run went on until every job had ended.
    pub is_complete: bool,
    /// For how long what is owed may be owed, in nanoseconds: a machine takes time from a
    /// finish to what follows from it, and from a decision to what a core does. Nothing
    /// may come too early. How late a timer is, is judged of waits only.
    ///
    /// 0: everything has the very time at which the model lets it happen, as in virtual
    /// time; then timers are punctual, too. [`u64::MAX`]: only order counts.
    pub tolerance_ns: u64,
    /// How late a timer may be that ends a wait at its limit, besides the tolerance, in nanoseconds.
    pub late_ns: u64,
}

impl JudgeOptions {
    /// Those of a whole run in virtual time.
    pub const EXACT: Self = Self::whole(0);

    /// Returns those of a run of which no event is missing, and jobs may be in flight.
    #[must_use]
    pub const fn whole(tolerance_ns: u64) -> Self {
        Self {
            is_whole: true,
            is_complete: false,
            tolerance_ns,
            late_ns: 0,
        }
    }
}

/// The times of all jobs of all DAGs.
#[derive(Clone, Debug)]
pub struct RunRecord {
    dags: Vec<DagRecord>,
}

#[derive(Clone, Debug)]
struct DagRecord {
    subtasks: usize,
    /// The number of the first job that is recorded.
    first_job: u64,
    jobs: Vec<JobRecord>,
    /// Job by job, within a job by subtask.
    instances: Vec<InstanceRecord>,
}

impl RunRecord {
    /// Makes an empty record with room for the jobs of each DAG whose numbers are in
    /// `jobs(dag)`.
    ///
    /// Returns `None` if there is no memory for so many jobs.
    fn with_jobs(task_set: &TaskSet, jobs: impl Fn(DagId) -> Range<u64>) -> Option<Self> {
        let dags = (0..).map(DagId).zip(task_set.dags()).map(|(id, dag)| {
            let Range { start, end } = jobs(id);
            let jobs = usize::try_from(end.saturating_sub(start)).ok()?;
            let subtasks = dag.subtasks().len();
            let instances = jobs.checked_mul(subtasks)?;
            Some(DagRecord {
                subtasks,
                first_job: start,
                jobs: filled(jobs)?,
                instances: filled(instances)?,
            })
        });
        Some(Self {
            dags: dags.collect::<Option<_>>()?,
        })
    }

    /// Returns the recorded jobs of a DAG, one number after the other from
    /// [`first_job`](Self::first_job) on.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    pub fn jobs(&self, dag: DagId) -> &[JobRecord] {
        &self.dags[dag.index()].jobs
    }

    /// Returns the number of the first recorded job of a DAG; not 0 if the memory did
    /// not hold all jobs.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    pub fn first_job(&self, dag: DagId) -> u64 {
        self.dags[dag.index()].first_job
    }

    /// Returns the recorded jobs of a DAG with their numbers.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    pub fn numbered(&self, dag: DagId) -> impl Iterator<Item = (u64, &JobRecord)> + Clone {
        (self.first_job(dag)..).zip(self.jobs(dag))
    }

    /// Returns one job, `None` if it is not recorded.
    pub fn job(&self, dag: DagId, job: u64) -> Option<&JobRecord> {
        let dag = self.dags.get(dag.index())?;
        Some(&dag.jobs[dag.position(job)?])
    }

    /// Returns the instances of a job by subtask; empty if it is not recorded.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    pub fn instances(&self, dag: DagId, job: u64) -> &[InstanceRecord] {
        let dag = &self.dags[dag.index()];
        let of_job = |place| &dag.instances[place * dag.subtasks..][..dag.subtasks];
        dag.position(job).map_or(&[], of_job)
    }

    /// Returns an instance's times, `None` if it is not recorded.
    pub fn instance(&self, instance: Instance) -> Option<&InstanceRecord> {
        self.instances(instance.dag, instance.job)
            .get(instance.subtask.index())
    }

    /// Returns an instance's times to be filled in, `None` if it is not recorded.
    fn instance_mut(&mut self, instance: Instance) -> Option<&mut InstanceRecord> {
        let dag = self.dags.get_mut(instance.dag.index())?;
        let first = dag.position(instance.job)? * dag.subtasks;
        let of_job = &mut dag.instances[first..][..dag.subtasks];
        of_job.get_mut(instance.subtask.index())
    }

    /// Returns a job's times to be filled in, `None` if it is not recorded.
    fn job_mut(&mut self, dag: DagId, job: u64) -> Option<&mut JobRecord> {
        let dag = self.dags.get_mut(dag.index())?;
        let place = dag.position(job)?;
        Some(&mut dag.jobs[place])
    }

    /// Returns when all predecessors of a subtask had finished their part of
    /// the job: the earliest time at which the model lets it become ready by R2.
    /// `None` if it has no predecessor, or one has not finished.
    pub fn join_ns(&self, task_set: &TaskSet, instance: Instance) -> Option<u64> {
        let Instance { dag, job, subtask } = instance;
        let job = self.instances(dag, job);
        let predecessors = task_set.dag(dag).predecessors(subtask);
        latest(predecessors.iter().map(|u| job.get(u.index())?.finish_ns))
    }

    /// Returns when a job was complete (R4): the latest finish of its subtasks.
    /// `None` if one has not finished.
    pub fn completion_ns(&self, dag: DagId, job: u64) -> Option<u64> {
        let instances = self.instances(dag, job).iter();
        latest(instances.map(|instance| instance.finish_ns))
    }

    /// Returns every recorded instance with its times: by DAG, job, subtask.
    pub fn all_instances<'a>(
        &'a self,
        task_set: &'a TaskSet,
    ) -> impl Iterator<Item = (Instance, &'a InstanceRecord)> {
        let dags = (0..).map(DagId).take(task_set.dags().len());
        let jobs = dags.flat_map(|dag| self.numbered(dag).map(move |(job, _)| (dag, job)));
        jobs.flat_map(|(dag, job)| {
            let instances = (0..).map(SubtaskId).zip(self.instances(dag, job));
            instances.map(move |(subtask, record)| (Instance { dag, job, subtask }, record))
        })
    }
}

impl DagRecord {
    fn position(&self, job: u64) -> Option<usize> {
        let place = usize::try_from(job.checked_sub(self.first_job)?).ok()?;
        (place < self.jobs.len()).then_some(place)
    }
}

/// Returns so many values that tell of nothing, `None` if there is no memory for them.
fn filled<T: Clone + Default>(count: usize) -> Option<Vec<T>> {
    let mut values = Vec::new();
    values.try_reserve_exact(count).ok()?;
    values.resize(count, T::default());
    Some(values)
}

/// Returns the latest of some times, `None` if one is missing or there are none.
fn latest(times: impl Iterator<Item = Option<u64>>) -> Option<u64> {
    times
        .reduce(|latest, time| Some(latest?.max(time?)))
        .flatten()
}
