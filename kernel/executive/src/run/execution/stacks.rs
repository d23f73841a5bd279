//! The stacks of a run: as many as its DAGs can need at once, taken at a commit.

use alloc::format;

use fass::LaunchError;
use sched_dag::{Preemption, SchedulerOptions, TaskSet};

use crate::run::contexts;

/// Makes sure that the stacks which a task set needs are there.
pub(super) fn provide(task_set: &TaskSet, options: SchedulerOptions) -> Result<(), LaunchError> {
    let subtasks = task_set.vertices();
    let cores = usize::try_from(options.cores).unwrap_or(usize::MAX);
    let suspended = match options.preemption {
        Preemption::Enabled => task_set.most_suspended(),
        Preemption::Disabled => 0,
    };
    let total = cores.saturating_mul(2).saturating_add(suspended);
    let needed = contexts::stack_bytes(task_set);
    let kib = needed / 1024;
    let settled = contexts::settle(needed).and_then(|settled| {
        contexts::provide(total)?;
        Ok(settled)
    });
    let settled = settled.map_err(|_| {
        LaunchError::new(format!(
            "{subtasks} subtasks and {cores} cores need {total} stacks of {kib} KiB, more than \
             there is memory for; register fewer subtasks, or give the machine more memory"
        ))
    })?;
    if settled < needed {
        return Err(LaunchError::new(format!(
            "a subtask states a stack of {kib} KiB, and the first commit has settled {} KiB; \
             state as much there",
            settled / 1024
        )));
    }
    Ok(())
}
