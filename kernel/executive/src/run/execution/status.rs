//! What the rest of the kernel may ask about the run.

use alloc::sync::Arc;
use core::sync::atomic::Ordering;

use sched_dag::engine::Cost;
use sched_dag::journal::Subject;
use sched_dag::{DagId, Instance, Journal, Scheduler, SubtaskId, TaskSet};

use super::cluster::{self, FIRST_SEAT};
use crate::machine::this_core::{self, Core};
use crate::memory::heap;

const _: () = {
    let any = Instance {
        dag: DagId(1),
        job: 0,
        subtask: SubtaskId(0),
    };
    // The heap tells by this whose memory it is.
    assert!(Subject::of(any).ids == 1 << heap::OWNER_BIT);
};

/// Stands where the ids of an instance do, for none.
const NOTHING: u64 = u64::MAX;

/// Returns how many jobs have ended in this run, of DAGs with a limit of jobs.
pub fn jobs_ended() -> u64 {
    let counts = cluster::all().map(|cluster| cluster.jobs_ended.load(Ordering::Relaxed));
    counts.sum()
}

/// Returns how often the schedulers' locks have been taken since boot, modulo 2^32.
pub fn lock_acquisitions() -> u32 {
    let counts = cluster::all().map(|cluster| cluster.execution.acquisitions());
    counts.fold(0, u32::wrapping_add)
}

/// Returns when core 0's timer shall next step its scheduler.
pub fn next_event_ns() -> u64 {
    cluster::nth(0).next_event_ns()
}

/// Calls `with` with the names of an instance's DAG and subtask, if they can be
/// had without waiting.
pub fn try_names(instance: Instance, with: impl FnOnce(&str, &str)) {
    let place = cluster::nth(0).execution.try_lock();
    let Some(execution) = place.as_ref().and_then(|execution| execution.as_ref()) else {
        return;
    };
    let dag = execution.task_set().dags().get(instance.dag.index());
    let subtask = dag.and_then(|dag| dag.subtasks().get(instance.subtask.index()));
    if let (Some(dag), Some(subtask)) = (dag, subtask) {
        with(dag.name(), subtask.name());
    }
}

/// Returns the instance that a core runs, without the lock.
pub fn running(core: &Core) -> Option<Instance> {
    let [ids, job] = core
        .running
        .each_ref()
        .map(|field| field.load(Ordering::Relaxed));
    (ids != NOTHING).then(|| Subject { ids, job }.instance())
}

/// Notes which instance a core runs, for [`running`].
pub(super) fn note_running(core: &Core, subject: Option<Subject>) {
    let (ids, job) = subject.map_or((NOTHING, 0), |subject| (subject.ids, subject.job));
    core.note_running([ids, job]);
}

/// Returns how long an instance that runs here may execute for, `u64::MAX` if there is no limit.
pub fn budget_ns(instance: Instance) -> u64 {
    let place = cluster::of(this_core::get()).execution.lock();
    place.as_ref().map_or(u64::MAX, |execution| {
        let dag = execution.task_set().dag(instance.dag);
        let subtask = dag.subtask(instance.subtask);
        subtask.most_execution_ns(execution.budget_factor)
    })
}

/// Returns what a fault of an instance that runs here costs if it comes now, and the model, if a
/// run goes on. Of two faults of a DAG at one moment, either may take what is left to be survived;
/// the journal tells.
pub fn cost_of_fault(instance: Instance) -> Option<(Cost, Arc<TaskSet>)> {
    let place = cluster::of(this_core::get()).execution.lock();
    place.as_ref().map(|execution| {
        let task_set = execution.task_set();
        let cost = execution.engine.cost_of_fault(task_set.vertex(instance));
        (cost, Arc::clone(task_set))
    })
}

/// Looks at the scheduler of a cluster, shortly, if there is one.
pub fn with_scheduler<T>(cluster: usize, look: impl FnOnce(&mut Scheduler) -> T) -> Option<T> {
    let mut place = cluster::nth(cluster).execution.lock();
    (place.as_mut()).map(|execution| look(&mut execution.engine.scheduler))
}

/// Looks at the journal of this core's cluster, if there is one and nobody is at work on it.
/// Its cores count from the second argument of `look`.
pub fn try_journal<R>(look: impl FnOnce(&Journal, u32) -> R) -> Option<R> {
    let cluster = match this_core::is_ready() {
        true => cluster::of(this_core::get()),
        false => cluster::nth(0),
    };
    let place = cluster.execution.try_lock()?;
    place.as_ref().map(|execution| {
        look(
            &execution.engine.scheduler.log.journal,
            cluster.core(FIRST_SEAT),
        )
    })
}
