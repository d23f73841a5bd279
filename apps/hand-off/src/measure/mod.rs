//! The measurements: each commits DAGs, runs them, and reads their stamps.

mod elsewhere;
mod local;
mod preemption;

use alloc::vec::Vec;
use core::time::Duration;

use fass::finish_create_dags;
use hand_off::{Shape, Stamping, Stamps, Workload, build};
use kernel::{Ending, Machine, Run};
use sched_dag::law::InstanceRecord;
use sched_dag::{DagId, Instance, SubtaskId};

use crate::row::emit;

pub(crate) use elsewhere::{joins, woken_cores};
pub(crate) use local::{budgets, chain, clock, fork_join, layered, wake_ups};
pub(crate) use preemption::preemption;

/// Describes a workload of empty bodies, released seldom enough for each job to be
/// complete before the next.
pub(crate) fn workload(shape: Shape, jobs: u64, stamping: Stamping) -> Workload {
    /// Room for an instance, even where a nanosecond is a real one.
    const PERIOD_OF_INSTANCE: Duration = Duration::from_micros(20);
    let instances = u32::try_from(shape.subtasks()).unwrap_or(u32::MAX);
    Workload {
        shape,
        jobs,
        period: Duration::from_millis(2) + PERIOD_OF_INSTANCE.saturating_mul(instances),
        stamping,
        work: Duration::ZERO,
        wcet: None,
    }
}

/// A run that has ended, with its stamps.
struct Measured {
    run: Run,
    stamps: Stamps,
    workload: Workload,
    dag: DagId,
    commit_ns: u64,
}

impl Measured {
    /// Commits and runs.
    fn run(machine: &Machine, workload: Workload) -> Result<Self, Ending> {
        let (dag, stamps) = build(&workload);
        let before_ns = fass::now_ns();
        let dags = [dag];
        finish_create_dags(&dags)?;
        let commit_ns = fass::now_ns() - before_ns;
        let run = run(machine)?;
        Ok(Self {
            dag: run.task_set().find(&dags[0]),
            run,
            stamps,
            workload,
            commit_ns,
        })
    }

    /// Prints what every workload has.
    fn emit_common(&self, name: &str) {
        let period_ns = u64::try_from(self.workload.period.as_nanos()).unwrap_or(u64::MAX);
        let release_ns = |job: u64| self.run.epoch_ns() + job * period_ns;
        let from_release: Vec<u64> = self
            .jobs()
            .filter_map(|job| since(self.stamps.first(0, job), Some(release_ns(job))))
            .collect();
        let least = from_release.iter().copied().min().unwrap_or(0);
        let jitter = from_release.iter().map(|ns| ns - least);
        emit(name, "release_jitter", 1, jitter);
        emit(name, "release_to_start", 1, from_release.iter().copied());
        emit(
            name,
            "commit",
            self.workload.shape.subtasks() as u64,
            [self.commit_ns],
        );
        emit(
            name,
            "allocations",
            self.workload.jobs,
            [self.run.allocations()],
        );
        let locks = u64::from(self.run.lock_acquisitions());
        let instances = self.workload.jobs * self.workload.shape.subtasks() as u64;
        emit(name, "locks", instances, [locks]);
    }

    fn jobs(&self) -> impl Iterator<Item = u64> + Clone + use<> {
        0..self.workload.jobs
    }

    /// Returns the times from the source's first to the sink's first instruction.
    fn source_to_sink(&self) -> impl Iterator<Item = u64> {
        let sink = self.workload.shape.subtasks() - 1;
        let stamps = &self.stamps;
        self.jobs()
            .filter_map(move |job| since(stamps.first(sink, job), stamps.first(0, job)))
    }

    /// Returns when the last of the sink's predecessors in a fork-join returned.
    fn last_return(&self, job: u64) -> Option<u64> {
        let sink = self.workload.shape.subtasks() - 1;
        (1..sink)
            .filter_map(|branch| self.stamps.last(branch, job))
            .max()
    }

    /// Returns when the scheduler made an instance ready.
    fn ready_ns(&self, subtask: usize, job: u64) -> Option<u64> {
        Some(self.run.epoch_ns() + self.instance(subtask, job)?.ready_ns?)
    }

    /// Returns what the scheduler did with an instance.
    fn instance(&self, subtask: usize, job: u64) -> Option<&InstanceRecord> {
        self.run.record().instance(Instance {
            dag: self.dag,
            job,
            subtask: SubtaskId(u32::try_from(subtask).ok()?),
        })
    }
}

/// Runs what is committed; a breach of the model's rules is an error.
fn run(machine: &Machine) -> Result<Run, Ending> {
    let run = machine.run()?;
    if let Some(violation) = run.violations().next() {
        return Err(Ending::Failure(alloc::format!("{violation}")));
    }
    Ok(run)
}

fn since(later: Option<u64>, earlier: Option<u64>) -> Option<u64> {
    later?.checked_sub(earlier?)
}
