//! What the clusters of a run that has ended leave behind.
//!
//! The bodies, and the values that waited for them, are dropped at once, DAG by DAG: outside any
//! instance, so a `drop` of the app's that panics or never returns cannot be contained. It can be
//! named ([`look_at_clearing`]).

use alloc::sync::Arc;

use sched_dag::{DagId, Instance, SubtaskId, TaskSet};

use super::{Execution, Loan};
use crate::machine::clock;
use crate::machine::spinlock::SpinLock;

/// The DAG whose bodies are being dropped, and since when.
static CLEARING: SpinLock<Option<(Arc<TaskSet>, DagId, u64)>> = SpinLock::new(None);

/// Hands over the name of the DAG whose bodies are being dropped, if that goes on, and since when
/// it does.
pub fn look_at_clearing<R>(look: impl FnOnce(&str, u64) -> R) -> Option<R> {
    let clearing = CLEARING.try_lock()?;
    let (task_set, dag, since_ns) = clearing.as_ref()?;
    Some(look(task_set.dag(*dag).name(), *since_ns))
}

/// Drops what the clusters of a run have left behind, and gives back what faults have left.
pub(super) fn clear(executions: &mut [Execution]) {
    let task_set = Arc::clone(executions[0].task_set());
    for (id, dag) in (0..).map(DagId).zip(task_set.dags()) {
        let engine = &mut executions[dag.cluster().index()].engine;
        *CLEARING.lock() = Some((Arc::clone(&task_set), id, clock::now_ns()));
        let of_dag = |lost: &mut Loan| lost.instance.dag == id;
        let lost = engine.lost.extract_if(.., of_dag);
        lost.for_each(|lost| lost.give_back().inner.body.forget());
        for subtask in (0..).map(SubtaskId).take(dag.subtasks().len()) {
            let any = Instance {
                dag: id,
                job: 0,
                subtask,
            };
            drop(
                engine
                    .placement
                    .take(task_set.vertex(any))
                    .map(Loan::give_back),
            );
        }
        drop(CLEARING.lock().take());
    }
}
