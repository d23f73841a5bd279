//! Judges and measures a run from its journal.
//!
//! All results are computed from the [events](crate::journal) written down by a driver:
//!
//! - [`violations`]: every breach of the model's rules R1 to R4, of the rules W1 and W2 for waits,
//!   and of two rules for every machine: one life of each instance, one instance on each core;
//! - [`dispatch_violations`]: every breach of R5 and of T1 to T4; [`sweep`] is its core;
//! - [`MeasuredCosts`]: the time taken by the platform's own work;
//! - [`RunRecord::of_events`]: the times of every job and instance; if the oldest events are lost,
//!   of the latest whole jobs only;
//! - [`RunTally`]: statistics of a run of any length, in a fixed amount of memory; each is read as
//!   a [`Distribution`].
//!
//! [`JudgeOptions`] says how strictly to judge a journal. Times are in nanoseconds from the run's
//! epoch.
//!
//! Nothing else checks the rules after a run: in virtual time, on threads, in the kernel, or for a
//! trace read from a file. The checks are written from the rules alone and share no code with the
//! scheduler, so an error in the scheduler cannot hide here. The checks miss faults that leave no
//! event: values gone astray, or a rule broken before the first remaining event.

mod costs;
mod dispatch;
mod distribution;
mod facts;
mod lives;
pub mod sweep;
mod tables;
mod tally;
mod violation;

use alloc::vec::Vec;
use core::ops::Range;

pub use costs::MeasuredCosts;
pub use dispatch::{DispatchReport, dispatch_violations, judge_dispatch};
pub use distribution::{Distribution, Histogram};
pub use lives::{LifeVerdict, judge, violations};
pub use tally::{DagTally, RunTally, SubtaskTally};
pub use violation::{Rule, Violation};

use crate::ids::{CoreId, DagId, Instance, SubtaskId};
use crate::policy::JobOutcome;
use crate::task_set::TaskSet;

/// The times of one instance; each `None` until its event has happened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InstanceRecord {
    /// When all conditions for its readiness had been met.
    pub ready_ns: Option<u64>,
    /// When its function was called.
    pub start_ns: Option<u64>,
    /// When its function had returned.
    pub finish_ns: Option<u64>,
    /// When a fault had ended the instance instead; `None` also if no event records the fault.
    pub failed_ns: Option<u64>,
    /// The core where the instance finished; before its finish, the core where it last ran.
    pub core: Option<CoreId>,
    /// How many times its function has returned; more than 1 is a violation.
    pub runs: u32,
    /// How many times the scheduler has preempted the instance.
    pub preemptions: u32,
}

/// The times of one job; each `None` until its event has happened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JobRecord {
    /// The nominal release time, once the job is released.
    pub release_ns: Option<u64>,
    /// When the release was carried out.
    pub released_ns: Option<u64>,
    /// When the job was cut, because it was aborted, had a fault, or its DAG was ended. A job that
    /// was cut starts no further instance.
    pub cut_ns: Option<u64>,
    /// Whether a fault has cut the job while its DAG went on.
    pub has_failed: bool,
    /// When the scheduler noticed that a deadline of the job, or of one of its sinks, had passed
    /// unmet.
    pub missed_ns: Option<u64>,
    /// When no instance of the job was left.
    pub ended_ns: Option<u64>,
    /// How the job ended; `None` if it had not ended by the end of the record, or was skipped.
    pub outcome: Option<JobOutcome>,
}

impl JobRecord {
    /// Returns the time from the nominal release to the end, also of a job that was cut, or `None`
    /// unless both are known.
    pub fn response_time_ns(&self) -> Option<u64> {
        Some(self.ended_ns?.saturating_sub(self.release_ns?))
    }
}

/// Options of the judge: whether the journal is whole, whether the run is complete, and tolerances.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JudgeOptions {
    /// Whether no event is missing. Otherwise the oldest events are missing, and the judge
    /// concludes nothing from the absence of an event that may be among them.
    pub is_whole: bool,
    /// Whether the run went on until every job had ended.
    pub is_complete: bool,
    /// How long an obligation may stay unfulfilled, in nanoseconds: a machine takes time from a
    /// finish to its consequences, and from a decision to the action of a core. Nothing may come
    /// too early. The lateness of timers is judged for waits only.
    ///
    /// 0 means exact times, as in virtual time: everything happens at the very time given by the
    /// model, and timers are punctual, too. With [`u64::MAX`], only order counts.
    pub tolerance_ns: u64,
    /// How late a timer may end a wait at its limit, in addition to the tolerance, in nanoseconds.
    pub late_ns: u64,
}

impl JudgeOptions {
    /// The options for a whole run in virtual time.
    pub const EXACT: Self = Self::whole(0);

    /// Returns the options for a run without missing events, perhaps with jobs in flight at its
    /// end.
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
    /// The number of the first recorded job.
    first_job: u64,
    jobs: Vec<JobRecord>,
    /// Ordered by job, then by subtask.
    instances: Vec<InstanceRecord>,
}

impl RunRecord {
    /// Makes an empty record with room for the jobs `jobs(dag)` of each DAG.
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

    /// Returns the recorded jobs of a DAG, in the order of their numbers, from
    /// [`first_job`](Self::first_job) on without gaps.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    pub fn jobs(&self, dag: DagId) -> &[JobRecord] {
        &self.dags[dag.index()].jobs
    }

    /// Returns the number of the first recorded job of a DAG. This is not the DAG's own first job
    /// if the oldest events are lost.
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

    /// Returns one job, or `None` if the record does not contain the job.
    pub fn job(&self, dag: DagId, job: u64) -> Option<&JobRecord> {
        let dag = self.dags.get(dag.index())?;
        Some(&dag.jobs[dag.position(job)?])
    }

    /// Returns the instances of a job by subtask; empty if the job is not recorded.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    pub fn instances(&self, dag: DagId, job: u64) -> &[InstanceRecord] {
        let dag = &self.dags[dag.index()];
        let of_job = |place| &dag.instances[place * dag.subtasks..][..dag.subtasks];
        dag.position(job).map_or(&[], of_job)
    }

    /// Returns the times of an instance, or `None` if the instance is not recorded.
    pub fn instance(&self, instance: Instance) -> Option<&InstanceRecord> {
        self.instances(instance.dag, instance.job)
            .get(instance.subtask.index())
    }

    /// Returns the times of an instance for filling in, or `None` if the instance is not recorded.
    fn instance_mut(&mut self, instance: Instance) -> Option<&mut InstanceRecord> {
        let dag = self.dags.get_mut(instance.dag.index())?;
        let first = dag.position(instance.job)? * dag.subtasks;
        let of_job = &mut dag.instances[first..][..dag.subtasks];
        of_job.get_mut(instance.subtask.index())
    }

    /// Returns the times of a job for filling in, or `None` if the job is not recorded.
    fn job_mut(&mut self, dag: DagId, job: u64) -> Option<&mut JobRecord> {
        let dag = self.dags.get_mut(dag.index())?;
        let place = dag.position(job)?;
        Some(&mut dag.jobs[place])
    }

    /// Returns when the last predecessor of an instance finished in the same job: the earliest time
    /// at which R2 lets the instance become ready. Returns `None` for a source, or if a predecessor
    /// has not finished.
    pub fn join_ns(&self, task_set: &TaskSet, instance: Instance) -> Option<u64> {
        let Instance { dag, job, subtask } = instance;
        let job = self.instances(dag, job);
        let predecessors = task_set.dag(dag).predecessors(subtask);
        latest(predecessors.iter().map(|u| job.get(u.index())?.finish_ns))
    }

    /// Returns when a job was complete (R4): the latest finish of its subtasks. Returns `None` if a
    /// subtask has not finished, as in most jobs that were cut, or if the job is not recorded.
    pub fn completion_ns(&self, dag: DagId, job: u64) -> Option<u64> {
        let instances = self.instances(dag, job).iter();
        latest(instances.map(|instance| instance.finish_ns))
    }

    /// Returns every recorded instance with its times, ordered by DAG, job, subtask.
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

/// Returns `count` default values, or `None` if there is no memory for them.
fn filled<T: Clone + Default>(count: usize) -> Option<Vec<T>> {
    let mut values = Vec::new();
    values.try_reserve_exact(count).ok()?;
    values.resize(count, T::default());
    Some(values)
}

/// Returns the latest of some times, or `None` if any is missing or there are none.
fn latest(times: impl Iterator<Item = Option<u64>>) -> Option<u64> {
    times
        .reduce(|latest, time| Some(latest?.max(time?)))
        .flatten()
}
