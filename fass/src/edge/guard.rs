//! Functions that a replay does not call.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::mem;

use sched_dag::{DagId, Instance, SubtaskId};

use crate::run::plan::{Body, Plan, Replacement, Subtask};

/// The instances whose functions are not called.
#[derive(Clone, Debug)]
pub(super) struct Passed {
    /// The DAGs whose inputs are recorded, in order.
    pub(super) dags: Vec<u16>,
    /// The jobs of these that have some, in order.
    pub(super) jobs: Vec<(u16, u64)>,
    /// The instances that were cut, in order.
    pub(super) cuts: Vec<(u16, u16, u64)>,
}

impl Passed {
    /// Reports whether the inputs of a DAG are recorded.
    pub(super) fn is_of(&self, dag: u16) -> bool {
        self.dags.binary_search(&dag).is_ok()
    }

    /// Adds an instance that is cut; `false`: it was before.
    pub(super) fn cut(&mut self, instance: Instance) -> bool {
        let Some((dag, subtask)) = narrow(instance) else {
            return false;
        };
        let cut = (dag, subtask, instance.job);
        let place = self.cuts.binary_search(&cut);
        place.map_err(|place| self.cuts.insert(place, cut)).is_err()
    }

    /// Reports whether an instance is one of them.
    pub(super) fn has(&self, instance: Instance) -> bool {
        let Some((dag, subtask)) = narrow(instance) else {
            return false;
        };
        let job = instance.job;
        self.is_of(dag)
            && (self.jobs.binary_search(&(dag, job)).is_err()
                || self.cuts.binary_search(&(dag, subtask, job)).is_ok())
    }
}

/// Returns the numbers of a DAG and of a subtask, as recordings have them.
pub(super) fn narrow(instance: Instance) -> Option<(u16, u16)> {
    let dag = u16::try_from(instance.dag.0).ok()?;
    Some((dag, u16::try_from(instance.subtask.0).ok()?))
}

/// A subtask some of whose instances are passed over.
struct Guarded {
    subtask: Box<dyn Subtask>,
    /// The instance, but for its job.
    of: Instance,
    passed: Arc<Passed>,
}

impl Subtask for Guarded {
    fn take_turn(&mut self, job: u64) {
        match self.passed.has(Instance { job, ..self.of }) {
            true => self.subtask.discard(job),
            false => self.subtask.take_turn(job),
        }
    }

    fn discard(&mut self, job: u64) {
        self.subtask.discard(job);
    }

    fn replacement(&self) -> Option<Replacement> {
        self.subtask.replacement()
    }

    fn replace(&mut self) {
        self.subtask.replace();
    }

    fn forget(self: Box<Self>) {
        self.subtask.forget();
    }
}

/// Makes all bodies of a plan pass over these.
pub(super) fn guard(plan: &mut Plan, passed: &Arc<Passed>) {
    for (dag, bodies) in (0..).map(DagId).zip(&mut plan.bodies) {
        let of_subtasks = (0..).map(SubtaskId).zip(mem::take(bodies));
        let guarded = of_subtasks.map(|(subtask, body): (_, Body)| {
            let of = Instance {
                dag,
                subtask,
                job: 0,
            };
            let passed = Arc::clone(passed);
            body.wrapped(|subtask| {
                Box::new(Guarded {
                    subtask,
                    of,
                    passed,
                })
            })
        });
        *bodies = guarded.collect();
    }
}
