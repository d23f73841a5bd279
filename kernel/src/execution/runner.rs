//! What runs the instances of one subtask.

use fass::Body;
use sched_dag::{Instance, Vertex};

use crate::trace::Subject;

/// A subtask's body, and what running an instance of it takes.
///
/// There is one for each subtask, as a subtask has one started instance at a time
/// (R2). It is boxed: between its place and the core that runs it moves a pointer.
pub(crate) struct Runner {
    pub(super) body: Body,
    pub(super) vertex: Vertex,
    /// The time that an instance may execute for, `u64::MAX` if for ever.
    pub(super) budget_ns: u64,
    /// The instance that it runs, or ran last.
    pub(super) instance: Instance,
    /// The part of [`subject`](Self::subject) that is the same for all.
    ids: u64,
    /// When that started, on the run's time.
    pub(super) start_ns: u64,
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
            start_ns: 0,
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
