//! What the execution keeps beside the scheduler: the bodies with their places,
//! the record, and tables of what is fixed for a run.

use alloc::boxed::Box;

use fass::Body;
use sched_dag::record::Record;
use sched_dag::{Instance, TaskSet, Vertex};

use super::placement::Placement;
use crate::machine::context::Parked;
use crate::platform::KERNEL;

/// All of it, for as long as a run goes on.
pub(super) struct Books {
    pub(super) record: Record,
    /// Bodies are boxed, so that moving one is moving a pointer.
    pub(super) placement: Placement<Box<Body>, Parked>,
    /// Each DAG's first vertex.
    first_vertices: Box<[u32]>,
    /// The budget of each vertex, `u64::MAX` if it has none.
    budgets_ns: Box<[u64]>,
}

impl Books {
    pub(super) fn new(
        task_set: &TaskSet,
        record: Record,
        bodies: impl Iterator<Item = Body>,
        cores: usize,
    ) -> Self {
        Self {
            record,
            placement: Placement::new(bodies.map(Box::new), cores),
            first_vertices: first_vertices(task_set),
            budgets_ns: budgets_ns(task_set),
        }
    }

    /// Returns the vertex of an instance's subtask.
    pub(super) fn vertex(&self, instance: Instance) -> Vertex {
        Vertex(self.first_vertices[instance.dag.index()] + instance.subtask.0)
    }

    /// Returns how long an instance of a subtask may execute for, `u64::MAX` if for
    /// ever.
    #[inline]
    pub(super) fn budget_ns(&self, vertex: Vertex) -> u64 {
        self.budgets_ns[vertex.index()]
    }
}

/// Returns each DAG's first vertex.
fn first_vertices(task_set: &TaskSet) -> Box<[u32]> {
    let mut next = 0;
    let first = task_set.dags().iter().map(|dag| {
        let first = next;
        // The verification has seen to it that subtasks can be counted so.
        next += u32::try_from(dag.subtasks().len()).unwrap_or(u32::MAX);
        first
    });
    first.collect()
}

/// Returns the budget of each vertex.
fn budgets_ns(task_set: &TaskSet) -> Box<[u64]> {
    let subtasks = task_set.dags().iter().flat_map(|dag| dag.subtasks());
    let budgets_ns = subtasks.map(|subtask| {
        subtask
            .budget_ns()
            .or_else(|| KERNEL.budget_of_wcet(subtask.wcet_ns()?))
            .unwrap_or(u64::MAX)
    });
    budgets_ns.collect()
}
