//! Division of the cores into clusters, and questions about several clusters at once.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec;
use core::sync::atomic::Ordering;

use fass::platform::LaunchError;
use sched_dag::lifecycle::{self, Lifecycle, Parts};
use sched_dag::{DagId, TaskSet};

use super::cluster::{BESIDES, ClusterState, Letters, OTHERS, nth};
use super::{ClusterRun, cluster};
use crate::machine::this_core;

/// Divides the cores, and the handling of requests, as a task set says. No core runs anything of a
/// DAG.
pub(super) fn divide(
    task_set: &TaskSet,
    lifecycle: Option<Box<dyn Lifecycle>>,
) -> Result<(Letters, Parts), LaunchError> {
    let parts = match task_set.is_divided() {
        true => {
            let divided = lifecycle::divide(task_set, lifecycle.as_deref());
            let (letters, parts) = divided.map_err(LaunchError::new)?;
            (Some(Arc::new(letters)), parts)
        }
        false => (None, vec![lifecycle]),
    };
    let cores = this_core::all();
    let count = task_set.clusters().count();
    if count > 1 && OTHERS.get().is_none() {
        // Each cluster has at least one core, and the cores without a cluster form one more.
        OTHERS.set((1..cores.len()).map(|_| ClusterState::new()).collect());
    }
    BESIDES.store(count - 1, Ordering::Relaxed);
    let mut rest = cores.iter();
    let all = u32::try_from(cores.len()).unwrap_or(u32::MAX);
    for (id, group) in task_set.clusters().zip(0..) {
        let its = task_set.cores_of(id, all);
        let cluster = nth(id.index());
        cluster.first_core.store(its.start, Ordering::Relaxed);
        for (core, seat) in rest.by_ref().take(its.len()).zip(0..) {
            core.group.store(group, Ordering::Relaxed);
            core.place.store(seat, Ordering::Relaxed);
        }
    }
    let none = u32::try_from(count).unwrap_or(u32::MAX);
    // The number after the last cluster's: its state never has a run, so these cores find no work.
    rest.for_each(|core| core.group.store(none, Ordering::Relaxed));
    Ok(parts)
}

/// Returns a DAG's cluster; cluster 0 if no run has the DAG.
#[inline]
pub(super) fn of_dag(dag: DagId) -> &'static ClusterState {
    match cluster::are_divided() {
        true => among_several(dag),
        false => &cluster::FIRST,
    }
}

/// Returns the number of the first core of a DAG's cluster.
pub fn first_core_of(dag: DagId) -> u32 {
    of_dag(dag).core(cluster::FIRST_SEAT)
}

fn among_several(dag: DagId) -> &'static ClusterState {
    let place = nth(0).execution.lock();
    let task_set = place.as_ref().map(ClusterRun::task_set);
    let dag = task_set.and_then(|task_set| task_set.dags().get(dag.index()));
    nth(dag.map_or(0, |dag| dag.cluster().index()))
}

/// Reports whether all jobs of the run have ended. A cluster's own word is only a sign: while this
/// function looks at another cluster, a letter from there may give the first cluster new work. All
/// clusters are therefore checked a second time, while none of them can act.
pub fn is_finished() -> bool {
    cluster::all().all(|cluster| cluster.is_finished.load(Ordering::Acquire))
        && (!cluster::are_divided() || rest(0))
}

/// Reports whether all clusters from a number on are at rest, all at the same moment.
fn rest(place: usize) -> bool {
    if place == cluster::count() {
        return true;
    }
    // Held through the recursion, so all clusters stand still at once. No deadlock: the order is
    // ascending, and nobody else holds the locks of two clusters.
    let cluster = nth(place);
    let execution = cluster.execution.lock();
    let scheduler = execution
        .as_ref()
        .map(|execution| &execution.engine.scheduler);
    scheduler.is_none_or(|scheduler| scheduler.is_finished())
        && !cluster.has_letters.load(Ordering::Acquire)
        && rest(place + 1)
}
