//! What the execution keeps beside the scheduler: the bodies with their places, and
//! the record.

use alloc::boxed::Box;
use alloc::vec::Vec;

use fass::Body;
use sched_dag::record::Record;
use sched_dag::{DagId, Instance, SubtaskId, TaskSet};

use super::placement::Placement;
use super::runner::Runner;
use crate::machine::context::Parked;
use crate::platform::KERNEL;

/// All of it, for as long as a run goes on.
pub(super) struct Books {
    pub(super) record: Record,
    pub(super) placement: Placement<Box<Runner>, Parked>,
}

impl Books {
    pub(super) fn new(
        task_set: &TaskSet,
        record: Record,
        bodies: Vec<Vec<Body>>,
        cores: usize,
    ) -> Self {
        let mut runners = Vec::new();
        for (dag, bodies) in (0..).map(DagId).zip(bodies) {
            for (subtask, body) in (0..).map(SubtaskId).zip(bodies) {
                let first_instance = Instance {
                    dag,
                    job: 0,
                    subtask,
                };
                runners.push(Box::new(Runner::new(
                    body,
                    task_set.vertex(first_instance),
                    first_instance,
                    budget_ns(task_set, first_instance),
                )));
            }
        }
        Self {
            record,
            placement: Placement::new(runners.into_iter(), cores),
        }
    }
}

/// Returns how long an instance of a subtask may execute for, `u64::MAX` if for
/// ever.
pub(super) fn budget_ns(task_set: &TaskSet, instance: Instance) -> u64 {
    let subtask = task_set.dag(instance.dag).subtask(instance.subtask);
    subtask
        .budget_ns()
        .or_else(|| KERNEL.budget_of_wcet(subtask.wcet_ns()?))
        .unwrap_or(u64::MAX)
}
