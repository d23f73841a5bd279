//! The scheduler with the bodies that it decides about: one per run.
//!
//! Every event passes through here, under the one lock: a completion, by the
//! core that finished, or the timer, on core 0. Each makes one step of the
//! scheduler (completions, releases, one dispatch) and notes what each core is
//! to run; [`sched_dag::placement`] then brings each core there.
//!
//! Times inside are the scheduler's: nanoseconds since the run's `epoch_ns`.

mod control;
mod core_set;
mod events;
mod runner;
mod signals;
mod status;
mod step;
mod time;
mod watcher;

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use alloc::boxed::Box;
use alloc::format;
use alloc::sync::Arc;
use alloc::vec::Vec;

use fass::{LaunchError, Plan};
use sched_dag::placement::Placement;
use sched_dag::{Dag, DagId, Instance, Journal, OnFault, Scheduler, SchedulerOptions};
use sched_dag::{SubtaskId, TaskSet};

use crate::machine::context::Parked;
use crate::machine::spinlock::SpinLock;
use crate::run::contexts;
pub use control::{Control, Snapshot, State, control, nominal_end_ns, snapshot, task_set};
pub use events::{complete, fail, find_work, interrupt};
pub use runner::Runner;
use signals::Signals;
pub use signals::{raise, raise_in_interrupt};
pub use status::{
    Cost, budget_ns, cost_of_fault, is_finished, jobs_ended, lock_acquisitions, next_event_ns,
    running, try_journal, try_names, with_journal,
};
pub use time::{arm_next_event, since_epoch};
use watcher::Watcher;

/// What a core is to do next.
pub enum Work {
    /// Call the subtask's function for the instance.
    Run(Box<Runner>),
    /// Go on with this context.
    Continue(Parked),
    /// Nothing.
    Rest,
}

/// What a step of the scheduler is about, besides the time.
enum Event {
    /// A release or a deadline is due.
    Time,
    /// The instance has finished.
    Completed(Instance),
    /// The instance was ended by a fault.
    Failed(Instance),
    /// A sporadic DAG gets a signal from outside.
    Signalled(DagId),
    /// A person wants a change.
    Control(Control),
}

/// A run, from its launch until it is taken out.
pub struct Execution {
    scheduler: Scheduler,
    /// What the scheduler's reports change.
    watcher: Watcher,
    /// What core 0 does when nothing is assigned to it, while something is.
    background: Option<Parked>,
    /// When the next dispatch is due, on the clock, if it waits for further events
    /// of the instant in hand.
    dispatch_due_ns: Option<u64>,
    /// How long a dispatch waits for further events of the same instant.
    coincidence_ns: u64,
    /// The budget of a subtask that has a WCET only, in WCETs; 0 for none.
    budget_factor: u64,
    /// Whether a completion may be all of a step: no dispatch is owed, nor ever
    /// waits.
    may_hand_off: bool,
    signals: Signals,
    /// What the commit has proven of each DAG.
    bounds_ns: Box<[Option<u64>]>,
    sink_bounds_ns: Box<[Vec<Option<u64>>]>,
}

static EXECUTION: SpinLock<Option<Execution>> = SpinLock::new(None);

/// Time 0 of the run, on the clock.
static EPOCH_NS: AtomicU64 = AtomicU64::new(u64::MAX);

/// When core 0's timer shall next step the scheduler, on the clock; `u64::MAX`
/// if never.
static NEXT_EVENT_NS: AtomicU64 = AtomicU64::new(u64::MAX);

/// Whether all jobs of the run have ended.
static FINISHED: AtomicBool = AtomicBool::new(false);

/// Jobs of DAGs with a limit that have ended in this run.
static JOBS_ENDED: AtomicU64 = AtomicU64::new(0);

/// What the platform says about a run, besides the scheduler's options.
#[derive(Clone, Copy, Debug)]
pub struct Terms {
    /// How long a dispatch waits for further events of the same instant.
    pub coincidence_ns: u64,
    /// The budget of a subtask that has a WCET only, in WCETs; 0 for none.
    pub budget_factor: u64,
    /// The most events that the journal has room for; `u64::MAX`: as many as make sense.
    pub most_events: u64,
}

/// Prepares a plan to be run. Takes all memory that the run will need.
pub fn prepare(mut plan: Plan, options: SchedulerOptions, terms: Terms) -> Result<(), LaunchError> {
    if EXECUTION.lock().is_some() {
        return Err(LaunchError::new(
            "other DAGs are committed already; run them first, or commit all in one call",
        ));
    }
    let subtasks: usize = plan.bodies.iter().map(|bodies| bodies.len()).sum();
    let cores = usize::try_from(options.cores).unwrap_or(usize::MAX);
    let faults = plan.task_set.dags().iter().map(survived_faults);
    let faults = faults.fold(0, usize::saturating_add);
    let total = subtasks.saturating_add(cores.saturating_mul(2));
    let total = total.saturating_add(faults);
    contexts::provide(total).map_err(|_| {
        let kib = contexts::STACK_BYTES / 1024;
        LaunchError::new(format!(
            "{subtasks} subtasks, {cores} cores and {faults} survived faults need {total} stacks \
             of {kib} KiB, more than there is memory for; register fewer subtasks, survive fewer \
             faults, or give the machine more memory"
        ))
    })?;
    let signals = Signals::new(&mut plan);
    let task_set = plan.task_set;
    let runners = runner::runners(&task_set, plan.bodies, terms.budget_factor);
    let others = runner::others(&task_set, plan.others, terms.budget_factor);
    let placement = Placement::new(runners, cores);
    let heap = crate::memory::heap::usage();
    let execution = Execution {
        scheduler: Scheduler::new(Arc::clone(&task_set), options),
        watcher: Watcher {
            journal: Journal::new(
                &task_set,
                heap.capacity_bytes - heap.in_use_bytes,
                terms.most_events,
            ),
            placement,
            others,
            task_set,
            instant_ns: 0,
            has_job_news: false,
            finished: None,
            finish_ns: 0,
        },
        background: None,
        dispatch_due_ns: None,
        coincidence_ns: terms.coincidence_ns,
        budget_factor: terms.budget_factor,
        may_hand_off: terms.coincidence_ns == 0,
        signals,
        bounds_ns: plan.bounds_ns.into(),
        sink_bounds_ns: plan.sink_bounds_ns.into(),
    };
    *EXECUTION.lock() = Some(execution);
    Ok(())
}

/// Returns how many faults a DAG survives, each of which keeps a context for good.
fn survived_faults(dag: &Dag) -> usize {
    match dag.on_fault() {
        OnFault::EndDag => 0,
        OnFault::DropJob(of) => of.in_all as usize,
    }
}

/// Sets time 0 of the prepared run, from which the releases count. Returns the
/// number of jobs to come, or `None` if nothing is prepared.
pub fn begin(epoch_ns: u64) -> Option<u64> {
    let mut place = EXECUTION.lock();
    let execution = place.as_mut()?;
    EPOCH_NS.store(epoch_ns, Ordering::Relaxed);
    execution.begin_signals();
    JOBS_ENDED.store(0, Ordering::Relaxed);
    execution.publish();
    let jobs = execution
        .scheduler
        .task_set()
        .dags()
        .iter()
        .map(|dag| dag.jobs().unwrap_or(0));
    Some(jobs.sum())
}

/// Takes the run out when it has ended.
pub fn end() -> Option<Execution> {
    EXECUTION.lock().take()
}

impl Execution {
    /// Returns the scheduler, for its model and its counters.
    pub const fn scheduler(&self) -> &Scheduler {
        &self.scheduler
    }

    /// Returns the response time that is proven of a DAG, if one is.
    pub fn bound_ns(&self, dag: DagId) -> Option<u64> {
        self.bounds_ns.get(dag.index()).copied().flatten()
    }

    /// Returns the response time that is proven of a sink, if one is.
    pub fn sink_bound_ns(&self, dag: DagId, sink: SubtaskId) -> Option<u64> {
        let place = self.task_set().dag(dag).sinks().binary_search(&sink).ok()?;
        *self.sink_bounds_ns.get(dag.index())?.get(place)?
    }

    /// Returns what has happened.
    pub const fn journal(&self) -> &Journal {
        &self.watcher.journal
    }

    /// Returns the model.
    pub const fn task_set(&self) -> &Arc<TaskSet> {
        &self.watcher.task_set
    }
}
