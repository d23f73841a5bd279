//! A body with the instance that it runs: all that a scheduler's engine handles.

use alloc::vec::Vec;

use sched_dag::journal::Subject;
use sched_dag::lifecycle::Request;
use sched_dag::{DagId, Instance, SubtaskId, TaskSet, Vertex, engine};

use super::plan::{Body, Replacement};

/// What runs the instances of one subtask, one after another (R2): the
/// [body](engine::Body) in a platform's `Engine`.
///
/// ```
/// use fass::{Plan, Runner};
///
/// /// A platform that runs the first job of all DAGs.
/// fn run_once(plan: Plan) {
///     for mut runner in Runner::all(&plan.task_set, plan.bodies) {
///         runner.run();
///     }
/// }
/// ```
#[derive(Debug)]
pub struct Runner {
    /// Its function, with its ends of the topics.
    pub body: Body,
    /// The subtask.
    pub vertex: Vertex,
    /// The instance that it runs, or ran last.
    pub instance: Instance,
    /// The part of the subject of events that is the same for all.
    ids: u64,
}

impl Runner {
    /// Makes one of each body of a plan, in the order of the vertices.
    ///
    /// See [`Runner`].
    pub fn all(task_set: &TaskSet, bodies: Vec<Vec<Body>>) -> impl Iterator<Item = Self> {
        let of_dags = (0..).map(DagId).zip(bodies);
        of_dags.flat_map(move |(dag, of_dag)| {
            let of_subtasks = (0..).map(SubtaskId).zip(of_dag);
            of_subtasks.map(move |(subtask, body)| {
                let job = 0;
                let instance = Instance { dag, job, subtask };
                Self {
                    body,
                    vertex: task_set.vertex(instance),
                    instance,
                    ids: Subject::of(instance).ids,
                }
            })
        })
    }

    /// Calls the function for the instance. It panics where [`Body::run`] does.
    ///
    /// See [`Runner`].
    #[inline]
    pub fn run(&mut self) {
        self.body.run(self.instance.job);
    }
}

impl engine::Body for Runner {
    type Alternate = Replacement;

    #[inline]
    fn set_job(&mut self, job: u64) {
        self.instance.job = job;
    }

    #[inline]
    fn subject(&self) -> Subject {
        let (ids, job) = (self.ids, self.instance.job);
        Subject { ids, job }
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
