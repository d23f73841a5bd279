//! Functions that a replay does not call.

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::mem;

use sched_dag::{DagId, Instance, SubtaskId};

use crate::run::plan::{Body, Plan};

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

/// Makes all bodies of a plan pass over these.
pub(super) fn guard(plan: &mut Plan, passed: &Arc<Passed>) {
    for (dag, bodies) in (0..).map(DagId).zip(&mut plan.bodies) {
        let of_subtasks = (0..).map(SubtaskId).zip(mem::take(bodies));
        let guarded = of_subtasks.map(|(subtask, body): (_, Body)| {
            let passed = Arc::clone(passed);
            body.before(move |job| !passed.has(Instance { dag, job, subtask }))
        });
        *bodies = guarded.collect();
    }
}
