//! What runs the instances of one subtask.

use alloc::boxed::Box;
use alloc::vec::Vec;

use fass::Body;
use sched_dag::journal::Subject;
use sched_dag::{DagId, Instance, SubtaskId, TaskSet, Vertex};

/// A subtask's body, and what running an instance of it takes.
///
/// There is one for each subtask, as a subtask has one started instance at a time
/// (R2). It is boxed: between its place and the core that runs it moves a pointer.
pub(crate) struct Runner {
    pub(super) body: Body,
    pub(super) vertex: Vertex,
    /// The time that an instance may execute for, `u64::MAX` if there is no limit.
    pub(super) budget_ns: u64,
    /// The instance that it runs, or ran last.
    pub(super) instance: Instance,
    /// The part of [`subject`](Self::subject) that is the same for all.
    ids: u64,
}

impl Runner {
    /// Makes the runner of a subtask, given any instance of it.
    pub(super) fn new(body: Body, vertex: Vertex, any: Instance, budget_ns: u64) -> Self {
        Self {
            body,
            vertex,
            budget_ns,
            instance: any,
            ids: Subject::of(any).ids,
        }
    }

    /// Calls the subtask's function for the instance.
    pub(crate) fn run(&mut self) {
        self.body.run(self.instance.job);
    }

    /// Returns the instance as events are recorded of it.
    #[inline]
    pub(super) const fn subject(&self) -> Subject {
        Subject {
            ids: self.ids,
            job: self.instance.job,
        }
    }
}

/// Makes a runner for each body, by vertex.
pub(super) fn runners(
    task_set: &TaskSet,
    bodies: Vec<Vec<Body>>,
    budget_factor: u64,
) -> impl Iterator<Item = Box<Runner>> {
    let of_dags = (0..).map(DagId).zip(bodies);
    of_dags.flat_map(move |(dag, bodies)| {
        let of_subtasks = (0..).map(SubtaskId).zip(bodies);
        of_subtasks.map(move |(subtask, body)| {
            let job = 0;
            let first = Instance { dag, job, subtask };
            let model = task_set.dag(dag).subtask(subtask);
            let budget_ns = model.most_execution_ns(budget_factor);
            Box::new(Runner::new(body, task_set.vertex(first), first, budget_ns))
        })
    })
}
