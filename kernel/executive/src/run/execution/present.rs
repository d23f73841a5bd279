//! The run whose DAGs are to change, and why they may not.

use alloc::sync::Arc;

use fass::LaunchError;
use sched_dag::{SchedulerOptions, TaskSet};

use super::{Proven, cluster, status};
use crate::machine::this_core;
use crate::run::edge;

/// What is known of a run to which DAGs are added, or from which one is removed.
pub(super) struct Present {
    pub(super) task_set: Arc<TaskSet>,
    pub(super) options: SchedulerOptions,
    pub(super) budget_factor: u64,
    /// The room for requests.
    pub(super) room: (usize, usize),
    pub(super) proven: Arc<Proven>,
}

impl Present {
    /// Looks at the run that has the plan with a number, unless none of its DAGs can be changed.
    pub(super) fn of(plan: u64) -> Result<Self, LaunchError> {
        if status::running(this_core::get()).is_some() {
            return Err(LaunchError::new(
                "a subtask adds or removes a dag; do it in the function that \
                 `Machine::run_with` calls",
            ));
        }
        let place = cluster::nth(0).execution.lock();
        let execution = place.as_ref().filter(|of| of.signals.are_of(plan));
        let Some(execution) = execution else {
            return Err(LaunchError::new(
                "a dag is added or removed, and the commit's dags do not run; do it in the \
                 function that `Machine::run_with` calls",
            ));
        };
        let present = Self {
            task_set: Arc::clone(execution.task_set()),
            options: execution.scheduler.options(),
            budget_factor: execution.budget_factor,
            room: execution.signals.room(),
            proven: Arc::clone(&execution.proven),
        };
        drop(place);
        if present.task_set.is_divided() {
            return Err(LaunchError::new(
                "the cores are divided, and a dag is added or removed, which the machine does for \
                 undivided cores only; leave one of the two out",
            ));
        }
        if edge::is_replay() {
            return Err(LaunchError::new(
                "the run is a replay, which has the DAGs of its recording; add DAGs to other runs",
            ));
        }
        Ok(present)
    }
}
