//! What runs the instances of one subtask.

use alloc::vec::Vec;

use fass::{Body, Replacement, Request};
use sched_dag::engine;
use sched_dag::journal::Subject;
use sched_dag::{DagId, Instance, SubtaskId, TaskSet, Vertex};

use super::Loan;
use super::cluster::{self, Cluster};

/// A subtask's body, and what running an instance of it takes.
///
/// There is one for each subtask, as a subtask has one started instance at a time
/// (R2). Between its place and the core that runs it moves a [`Loan`](super::Loan).
pub struct Runner {
    pub(super) body: Body,
    pub(super) vertex: Vertex,
    cluster: &'static Cluster,
    /// The time that an instance may execute for, `u64::MAX` if there is no limit.
    pub(super) budget_ns: u64,
    /// The instance that it runs, or ran last.
    pub(super) instance: Instance,
    /// The part of [`subject`](Self::subject) that is the same for all.
    ids: u64,
}

impl Runner {
    /// Makes the runner of the subtask that an instance is of.
    fn new(body: Body, task_set: &TaskSet, any: Instance, budget_factor: u64) -> Self {
        let dag = task_set.dag(any.dag);
        Self {
            body,
            vertex: task_set.vertex(any),
            cluster: cluster::nth(dag.cluster().index()),
            budget_ns: dag.subtask(any.subtask).most_execution_ns(budget_factor),
            instance: any,
            ids: Subject::of(any).ids,
        }
    }

    /// Returns the cluster that runs it.
    #[inline]
    pub(super) const fn cluster(&self) -> &'static Cluster {
        match cluster::MAY_DIVIDE {
            true => self.cluster,
            false => &cluster::FIRST,
        }
    }

    /// Calls the subtask's function for the instance.
    pub fn run(&mut self) {
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
) -> impl Iterator<Item = Runner> {
    let of_dags = (0..).map(DagId).zip(bodies);
    of_dags.flat_map(move |(dag, of_dag)| {
        let of_subtasks = (0..).map(SubtaskId).zip(of_dag);
        of_subtasks.map(move |(subtask, body)| {
            let any = Instance {
                dag,
                job: 0,
                subtask,
            };
            Runner::new(body, task_set, any, budget_factor)
        })
    })
}

impl engine::Body for Loan {
    type Alternate = Replacement;

    #[inline]
    fn set_job(&mut self, job: u64) {
        self.instance.job = job;
    }

    #[inline]
    fn subject(&self) -> Subject {
        Runner::subject(self)
    }

    fn discard(&mut self, job: u64) {
        self.body.discard(job);
    }

    #[inline]
    fn has_effects(&self) -> bool {
        self.body.has_effects()
    }

    #[inline]
    fn complete(&mut self, finish_ns: u64, ask: &mut dyn FnMut(Request)) {
        self.body.complete(finish_ns, ask);
    }

    fn alternate(&self) -> Option<Replacement> {
        self.body.replacement()
    }

    fn replace(&mut self) {
        self.body.replace();
    }
}
