//! What a person may ask of a run, and change in it, while it goes on.
//!
//! To be called by core 0's background. Each question and each change holds a
//! cluster's lock for a bounded time; nothing is allocated.

use alloc::sync::Arc;
use core::sync::atomic::Ordering;

use sched_dag::lifecycle::Request;
use sched_dag::{Dag, DagId, TaskSet};

use super::core_set::CoreSet;
use super::{cluster, divided};
use crate::machine::timer::{self, Alarm};
use crate::machine::{clock, this_core};

/// Returns the model of the run, if one goes on.
pub fn task_set() -> Option<Arc<TaskSet>> {
    let place = cluster::nth(0).execution.lock();
    place.as_ref().map(|execution| execution.task_set().clone())
}

/// Returns the latest deadline of any job, on the run's time; `None` if there is
/// no run, or no last job.
pub fn nominal_end_ns() -> Option<u64> {
    let end_ns = |dag: &Dag| {
        let last = dag.jobs().filter(|_| !dag.is_sporadic())?.checked_sub(1)?;
        let release_ns = dag.period_ns().checked_mul(last)?;
        let release_ns = release_ns.checked_add(dag.offset_ns())?;
        release_ns.checked_add(dag.relative_deadline_ns())
    };
    let task_set = task_set()?;
    let ends = task_set.dags().iter().map(end_ns);
    ends.reduce(|one, other| Some(one?.max(other?))).flatten()
}

/// Makes a change to a DAG, in a step of its scheduler.
pub fn control(dag: DagId, change: fn(DagId) -> Request) {
    serve(None, dag, change(dag));
}

/// Serves a request to a DAG in a step of its scheduler; one to the DAG of the plan with a number
/// only if that is the one which runs, and as of time 0 if it has not begun.
///
/// This is the only such step, so that the scheduler is known by its address in it, too.
pub(super) fn serve(plan: Option<u64>, dag: DagId, request: Request) {
    let cluster = divided::of_dag(dag);
    let mut place = cluster.execution.lock();
    let Some(execution) = place.as_mut() else {
        return;
    };
    match plan {
        Some(plan) if plan != execution.signals.plan => return,
        Some(_) if !execution.signals.has_begun => {
            return execution.engine.requests.keep(request);
        }
        _ => {}
    }
    let mut woken = CoreSet::default();
    let seat = cluster::visit(cluster);
    execution.step(clock::now_ns(), &mut woken, |moment| moment.serve(request));
    this_core::get().place.store(seat, Ordering::Relaxed);
    drop(place);
    woken.wake();
    // The step may want this core, too, which follows at its next interrupt.
    timer::set(Alarm::Schedule, clock::now_ns());
}
