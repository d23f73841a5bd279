//! The scheduler, with the bodies of its subtasks: one for each cluster of a run.
//!
//! Every event passes through here under the cluster's one lock: a completion, on the finishing
//! core, or the timer, on the cluster's first core. Each event makes one step of the scheduler
//! (completions, releases, one dispatch) and notes the instance each core is to run;
//! [`sched_dag::placement`] then makes each core follow. Undivided cores form one cluster.
//!
//! To a scheduler and a placement, a core is its *seat*: its number within the cluster.
//!
//! Times inside are on the scheduler's time: nanoseconds since the run's `epoch_ns`.

mod cluster;
mod divided;
#[allow(unsafe_code, reason = "what a fault has left on a stack is taken back")]
mod loans;
mod port;
mod status;
mod step;

use core::sync::atomic::{AtomicU64, Ordering};

use alloc::sync::Arc;
use alloc::vec::Vec;

use fass::platform::{LaunchError, Plan, RunConfig};
use sched_dag::engine::{Engine, ProvenBounds, Run};
use sched_dag::{Dag, Journal, TaskSet};

use crate::machine::context::Parked;
use crate::machine::this_core;
pub use cluster::{count as clusters, first_core};
pub use divided::{first_core_of, is_finished};
pub use loans::RunnerLoan;
use loans::RunnerTable;
use port::{CoreRunner, SmpPort};
pub use port::{arm_all, arm_next_event, keeps_time, since_epoch};
pub use status::look_at_clearing;
pub use status::{control, nominal_end_ns, task_set};
pub use status::{
    has_bound, jobs_ended, lock_acquisitions, next_event_ns, running, try_journal, try_names,
    with_scheduler,
};
use step::RequestQueue;
pub use step::{answer, raise, raise_in_interrupt};
pub use step::{complete, device_interrupt, fail, find_work, interrupt};

/// The next work of a core.
pub enum CoreWork {
    /// Call the subtask's function for the instance.
    Run(RunnerLoan),
    /// Continue this context.
    Continue(Parked),
    /// No work.
    Rest,
}

/// One cluster's part of a run, from the launch until the run is taken out.
struct ClusterRun {
    engine: Engine<RunnerLoan, Parked>,
    loans: RunnerTable,
    cluster: &'static cluster::ClusterState,
    /// Core 0's background context, while parked because core 0 has an instance.
    background: Option<Parked>,
    /// When the next dispatch is due, on the clock, if the dispatch waits for further events of the
    /// current instant.
    dispatch_due_ns: Option<u64>,
    /// How long a dispatch waits for further events of the same instant, in nanoseconds.
    coincidence_ns: u64,
    /// Whether a completion alone may be the whole step: no dispatch is owed, and none ever waits.
    may_hand_off: bool,
    signals: RequestQueue,
    /// The proven bounds, kept in the first cluster only.
    proven: ProvenBounds,
}

/// Time 0 of the run, on the clock.
static EPOCH_NS: AtomicU64 = AtomicU64::new(u64::MAX);

/// Reports, as an error, an already prepared or running plan. Asked before anything is done for
/// another plan, as an instance may commit, too.
pub fn refuse_another() -> Result<(), LaunchError> {
    match cluster::nth(0).execution.lock().is_some() {
        true => Err(LaunchError::new(
            "other DAGs are committed already; run them first, or commit all in one call",
        )),
        false => Ok(()),
    }
}

/// Prepares a plan to be run; a dispatch waits `coincidence_ns` for further events of the same
/// instant. Takes all memory for the run.
pub fn prepare(mut plan: Plan, terms: &RunConfig, coincidence_ns: u64) -> Result<(), LaunchError> {
    let options = terms.scheduler;
    // First, since it may be refused: so far nothing has changed but the stock of contexts.
    port::provide(&plan.task_set, options)?;
    let lifecycle = plan.lifecycle.take();
    let task_set = &plan.task_set;
    let (letters, parts) = divided::divide(task_set, lifecycle)?;
    let heap = crate::memory::heap::usage();
    // Each cluster's journal gets an equal share of the heap now free.
    let share = task_set.clusters().count();
    let free_bytes = (heap.capacity_bytes - heap.in_use_bytes) / share;
    let most_events = terms.most_events / share as u64;
    let journal = |id| Journal::of_cluster(task_set, id, free_bytes, most_events);
    let after_fault = &plan.after_fault;
    let engines =
        Engine::of_clusters::<SmpPort<'_>>(task_set, options, parts, after_fault, journal);
    let mut executions: Vec<ClusterRun> = engines
        .map(|engine| ClusterRun {
            loans: RunnerTable::new(task_set.vertices()),
            cluster: cluster::nth(engine.cluster.index()),
            engine,
            background: None,
            dispatch_due_ns: None,
            coincidence_ns,
            may_hand_off: coincidence_ns == 0,
            signals: RequestQueue::new(&plan, &letters),
            proven: ProvenBounds::default(),
        })
        .collect();
    executions[0].proven = plan.proven;
    for runner in port::runners(task_set, plan.bodies, terms.budget_factor) {
        let cluster = task_set.dag(runner.instance.dag).cluster();
        let ClusterRun { engine, loans, .. } = &mut executions[cluster.index()];
        let loan = loans.lend(runner);
        engine.put(loan.vertex, loan);
    }
    for (number, execution) in executions.into_iter().enumerate() {
        *cluster::nth(number).execution.lock() = Some(execution);
    }
    Ok(())
}

/// Sets time 0 of the prepared run, the origin of all releases. Returns the number of jobs to come,
/// or `None` if nothing is prepared.
pub fn set_epoch(epoch_ns: u64) -> Option<u64> {
    let task_set = task_set()?;
    // Before any `publish` below, which places the first event on the clock by this epoch.
    EPOCH_NS.store(epoch_ns, Ordering::Relaxed);
    for cluster in cluster::all() {
        cluster.jobs_ended.store(0, Ordering::Relaxed);
        if let Some(execution) = cluster.execution.lock().as_mut() {
            execution.begin_signals();
            execution.publish();
        }
    }
    let jobs_of = |dag: &Dag| dag.jobs().unwrap_or(0).saturating_sub(dag.first_job());
    Some(task_set.dags().iter().map(jobs_of).sum())
}

/// Takes out the ended run, and drops the remaining bodies and values.
pub fn take_run() -> Option<Run> {
    // Out of the locks before anything is dropped: a drop is the app's code, and may take long.
    let parts = cluster::all().filter_map(|cluster| cluster.execution.lock().take());
    let mut parts: Vec<ClusterRun> = parts.collect();
    let (first, others) = parts.split_first_mut()?;
    let cores = u32::try_from(this_core::all().len()).unwrap_or(u32::MAX);
    let proven = core::mem::take(&mut first.proven);
    let mut run = Run::from_engine(&mut first.engine, proven, cores);
    (others.iter_mut()).for_each(|other| run.absorb(&mut other.engine));
    status::clear(&mut parts);
    Some(run)
}

impl ClusterRun {
    const fn task_set(&self) -> &Arc<TaskSet> {
        &self.engine.task_set
    }
}
