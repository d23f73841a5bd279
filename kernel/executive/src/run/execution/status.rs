//! Queries and changes of a run in progress, for the rest of the kernel and for a person.
//!
//! Called by core 0's background. Each question and each change holds a cluster's lock for a
//! bounded time; nothing is allocated.
//!
//! # After a run: the bodies and values left behind by its clusters
//!
//! All are dropped at once, DAG by DAG. The drop happens outside any instance, so an app's `drop`
//! that panics or never returns cannot be contained, but the report can name its DAG
//! ([`look_at_clearing`]).

use alloc::sync::Arc;
use core::sync::atomic::Ordering;

use sched_dag::engine::{PlatformPort as _, ProvenBounds};
use sched_dag::journal::EventSubject;
use sched_dag::lifecycle::Request;
use sched_dag::{Dag, DagId, Instance, Journal, Scheduler, SubtaskId, TaskSet};

use super::cluster::{self, ClusterState, CoreSet, FIRST_SEAT};
use super::{ClusterRun, RunnerLoan, divided};
use crate::machine::spinlock::SpinLock;
use crate::machine::this_core::{self, Core};
use crate::machine::timer::{self, Alarm};
use crate::machine::{clock, time_slice};
use crate::memory::heap;

const _: () = {
    let any = Instance {
        dag: DagId(1),
        job: 0,
        subtask: SubtaskId(0),
    };
    // The heap identifies the owner of memory by this bit.
    assert!(EventSubject::of(any).ids == 1 << heap::OWNER_BIT);
};

/// The place of an instance's ids when there is no instance.
const NOTHING: u64 = u64::MAX;

/// Returns the number of jobs ended in this run, of DAGs with a limit of jobs.
pub fn jobs_ended() -> u64 {
    let counts = cluster::all().map(|cluster| cluster.jobs_ended.load(Ordering::Relaxed));
    counts.sum()
}

/// Returns how often the schedulers' locks have been taken since boot, modulo 2^32.
pub fn lock_acquisitions() -> u32 {
    let counts = cluster::all().map(|cluster| cluster.execution.acquisitions());
    counts.fold(0, u32::wrapping_add)
}

/// Returns when core 0's timer shall next step its scheduler, in nanoseconds on the clock.
pub fn next_event_ns() -> u64 {
    cluster::nth(0).next_event_ns()
}

/// Calls `with` with the names of an instance's DAG and subtask, if available without waiting.
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

/// Returns a core's running instance, without the lock.
pub fn running(core: &Core) -> Option<Instance> {
    let [ids, job] = core
        .running
        .each_ref()
        .map(|field| field.load(Ordering::Relaxed));
    (ids != NOTHING).then(|| EventSubject { ids, job }.instance())
}

/// Notes a core's running instance, for [`running`].
pub(super) fn note_running(core: &Core, subject: Option<EventSubject>) {
    let (ids, job) = subject.map_or((NOTHING, 0), |subject| (subject.ids, subject.job));
    core.note_running([ids, job]);
}

/// Reports whether the commit has proven any bound for this run.
pub fn has_bound() -> bool {
    let place = cluster::nth(0).execution.lock();
    place.as_ref().is_some_and(|execution| {
        let ProvenBounds {
            bounds_ns,
            sink_bounds_ns,
        } = &execution.proven;
        let mut all = bounds_ns.iter().chain(sink_bounds_ns.iter().flatten());
        all.any(Option::is_some)
    })
}

/// Looks briefly at a cluster's scheduler, if there is a run.
pub fn with_scheduler<T>(cluster: usize, look: impl FnOnce(&mut Scheduler) -> T) -> Option<T> {
    // Before the lock: the cores visited meanwhile would only wait for its holder.
    time_slice::look_up();
    let mut place = cluster::nth(cluster).execution.lock();
    (place.as_mut()).map(|execution| look(&mut execution.engine.scheduler))
}

/// Looks at the journal of this core's cluster, if there is a journal and its lock is free. The
/// journal counts cores from the second argument of `look`.
pub fn try_journal<R>(look: impl FnOnce(&Journal, u32) -> R) -> Option<R> {
    // A panic during the boot asks before any core has its data.
    let cluster = match this_core::is_ready() {
        true => cluster::cluster_of(this_core::get()),
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

/// Returns the model of the current run, if any.
pub fn task_set() -> Option<Arc<TaskSet>> {
    let place = cluster::nth(0).execution.lock();
    place.as_ref().map(|execution| execution.task_set().clone())
}

/// Returns the latest deadline of any job, on the run's time, in nanoseconds; `None` if there is no
/// run, or no last job.
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
    serve(None, divided::of_dag(dag), change(dag));
}

/// Serves a request in a step of a cluster's scheduler, or sends the request to the concerned
/// cluster. A request with a plan's number counts only if that plan is committed now, and as of
/// time 0 if its run has not begun.
pub(super) fn serve(plan: Option<u64>, cluster: &'static ClusterState, request: Request) {
    let mut place = cluster.execution.lock();
    let Some(execution) = place.as_mut() else {
        return;
    };
    if plan.is_some_and(|plan| plan != execution.signals.plan) {
        return;
    }
    let mut woken = CoreSet::default();
    if execution.parts(&mut woken).1.forward(request) {
        drop(place);
        return woken.wake();
    }
    if plan.is_some() && !execution.signals.has_begun {
        return execution.engine.requests.keep(request);
    }
    let seat = cluster::visit(cluster);
    execution.step(clock::now_ns(), &mut woken, |moment| moment.serve(request));
    this_core::get().place.store(seat, Ordering::Relaxed);
    // Outside the lock, so that no woken core finds the lock taken by this one.
    drop(place);
    woken.wake();
    // The step may want this core, too, which can switch in an interrupt only: an alarm due at once
    // makes one.
    if !this_core::get().follows.load(Ordering::Relaxed) {
        timer::set(Alarm::Schedule, clock::now_ns());
    }
}

/// The DAG whose bodies are being dropped, and since when.
static CLEARING: SpinLock<Option<(Arc<TaskSet>, DagId, u64)>> = SpinLock::new(None);

/// Passes `look` the name of the DAG whose bodies are being dropped, if any, and the start of that
/// drop in nanoseconds on the clock.
pub fn look_at_clearing<R>(look: impl FnOnce(&str, u64) -> R) -> Option<R> {
    let clearing = CLEARING.try_lock()?;
    let (task_set, dag, since_ns) = clearing.as_ref()?;
    Some(look(task_set.dag(*dag).name(), *since_ns))
}

/// Drops the bodies left behind by a run's clusters, and recovers the runners lost to faults.
pub(super) fn clear(executions: &mut [ClusterRun]) {
    let task_set = Arc::clone(executions[0].task_set());
    for (id, dag) in (0..).map(DagId).zip(task_set.dags()) {
        let engine = &mut executions[dag.cluster().index()].engine;
        *CLEARING.lock() = Some((Arc::clone(&task_set), id, clock::now_ns()));
        let of_dag = |lost: &mut RunnerLoan| lost.instance.dag == id;
        // These bodies are forgotten, not dropped: a fault has left their functions in the middle
        // of their work, and a destructor would run on whatever they left behind.
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
                    .map(RunnerLoan::give_back),
            );
        }
        drop(CLEARING.lock().take());
    }
}
