//! The stacks of a run: as many as its DAGs can need at once, taken at a commit.

use alloc::format;

use fass::LaunchError;
use sched_dag::{Dag, OnFault, Preemption, SchedulerOptions, TaskSet};

use crate::run::contexts;

/// What DAGs need.
pub(super) struct Stacks {
    subtasks: usize,
    cores: usize,
    faults: usize,
    total: usize,
    /// How large each is.
    bytes: u64,
}

impl Stacks {
    pub(super) fn of(task_set: &TaskSet, options: SchedulerOptions) -> Self {
        let cores = usize::try_from(options.cores).unwrap_or(usize::MAX);
        let faults = task_set.dags().iter().map(survived_faults);
        let faults = faults.fold(0, usize::saturating_add);
        let suspended = match options.preemption {
            Preemption::Enabled => task_set.most_suspended(),
            Preemption::Disabled => 0,
        };
        let total = cores.saturating_mul(2).saturating_add(suspended);
        Self {
            subtasks: task_set.vertices(),
            cores,
            faults,
            total: total.saturating_add(faults),
            bytes: contexts::stack_bytes(task_set),
        }
    }

    /// Makes sure that they are there.
    pub(super) fn provide(&self) -> Result<(), LaunchError> {
        let settled = contexts::settle(self.bytes).and_then(|settled| {
            contexts::provide(self.total)?;
            Ok(settled)
        });
        self.check(settled.map_err(|_| self.too_many())?)
    }

    /// Does the same during a run, and takes nothing if there is no memory for all of them.
    pub(super) fn provide_more(&self) -> Result<(), LaunchError> {
        self.check(contexts::settled_bytes())?;
        match contexts::can_provide(self.total) {
            true => self.provide(),
            false => Err(self.too_many()),
        }
    }

    /// Refuses stacks of a size that is too small.
    fn check(&self, settled: u64) -> Result<(), LaunchError> {
        if settled >= self.bytes {
            return Ok(());
        }
        Err(LaunchError::new(format!(
            "a subtask states a stack of {} KiB, and the first commit has settled {} KiB; \
             state as much there",
            self.bytes / 1024,
            settled / 1024
        )))
    }

    fn too_many(&self) -> LaunchError {
        let Self {
            subtasks,
            cores,
            faults,
            total,
            bytes,
        } = self;
        LaunchError::new(format!(
            "{subtasks} subtasks, {cores} cores and {faults} survived faults need {total} stacks \
             of {} KiB, more than there is memory for; register fewer subtasks, survive fewer \
             faults, or give the machine more memory",
            bytes / 1024
        ))
    }
}

/// Returns how many faults a DAG survives, each of which keeps a context for good.
fn survived_faults(dag: &Dag) -> usize {
    match dag.on_fault() {
        OnFault::EndDag => 0,
        OnFault::DropJob(of) => of.in_all as usize,
    }
}
