//! Signals from one cluster to a DAG of another.
//!
//! Such a signal is a *letter*: it is counted for the DAG, and the other
//! cluster's first core is woken, which takes it in a step of its own. That takes no lock, so
//! nobody waits; there are as many letters as signals, however late they are taken.

use alloc::sync::Arc;
use core::sync::atomic::{AtomicU32, Ordering};

use fass::Plan;
use sched_dag::{ClusterId, DagId, Moment};

use super::cluster::{FIRST_SEAT, nth};
use super::core_set::CoreSet;
use super::watcher::Watcher;

/// How many letters there are for each DAG; all clusters have the same ones.
pub(super) type Letters = Arc<[AtomicU32]>;

/// Makes room for the letters of a run.
pub(super) fn room(plan: &Plan) -> Letters {
    plan.bodies.iter().map(|_| AtomicU32::new(0)).collect()
}

/// Counts a signal to a DAG of another cluster, and adds the core that has to take it.
pub(super) fn send(letters: &Letters, dag: DagId, there: ClusterId, woken: &mut CoreSet) {
    let there = nth(there.index());
    letters[dag.index()].fetch_add(1, Ordering::Relaxed);
    // What was counted before is seen by the core that takes the letters.
    there.has_letters.store(true, Ordering::Release);
    woken.insert(there.core(FIRST_SEAT));
}

/// Takes the letters that have come.
pub(super) fn take(
    letters: &Letters,
    cluster: ClusterId,
    moment: &mut Moment<'_>,
    watcher: &mut Watcher,
) {
    watcher.cluster().has_letters.swap(false, Ordering::AcqRel);
    for (dag, waiting) in (0..).map(DagId).zip(letters.iter()) {
        if watcher.task_set.dag(dag).cluster() == cluster {
            let count = waiting.swap(0, Ordering::Relaxed);
            (0..count).for_each(|_| moment.signal(dag, watcher));
        }
    }
}
