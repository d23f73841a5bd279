//! DAGs that join a run: rules A1 to A4 of `sched-dag/src/scheduler/adding.rs`, on the machine.
//!
//! Core 0's background makes all that they need, while instances preempt it: stacks, places, room,
//! a scheduler of all DAGs. One *switch* then puts that in place, under the cluster's lock: a step
//! for each DAG, each subtask, each slot and each core, which allocates and frees nothing (only
//! where functions may end the run, the list of its DAGs grows).
//!
//! The time of added DAGs begins a *lead* after the preparations have begun. If these took longer,
//! because instances kept the core, the scheduler is made anew with twice the lead. So the switch
//! is never late, and no release of an added DAG is.
//!
//! Only an image whose app calls for it has this code.

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::mem::swap;

use fass::{LaunchError, Plan};
use sched_dag::law::Tally;
use sched_dag::lifecycle::Requests;
use sched_dag::{ClusterId, DagId, Journal, Scheduler, SchedulerOptions, TaskSet};

use super::core_set::CoreSet;
use super::present::Present;
use super::time::since_epoch;
use super::watcher::Larger;
use super::{Execution, Proven, Stacks, cluster, leaving, runner};
use crate::machine::{clock, this_core};

/// The first lead that is tried.
const LEAST_LEAD_NS: u64 = 1_000_000;

/// What depends on when the time of the added DAGs begins.
struct Timed {
    task_set: Arc<TaskSet>,
    scheduler: Scheduler,
    tally: Option<Tally>,
}

/// What does not.
struct Untimed {
    watched: Larger,
    requests: Requests,
    after_fault: Vec<Option<DagId>>,
    proven: Arc<Proven>,
}

/// Adds the DAGs of a plan to the run of that number, and returns when their time begins, on the
/// run's.
pub fn add(plan: Plan) -> Result<u64, LaunchError> {
    let present = Present::of(plan.number)?;
    if leaving::is_shut_down(&present.task_set) {
        return Err(LaunchError::new(
            "a dag is added to a run that is being shut down; add it before, or to the next run",
        ));
    }
    let added = Arc::clone(&plan.task_set);
    let all = |from_ns| Arc::new(present.task_set.with_added(&added, from_ns));
    let some = all(0);
    let in_need = some.only(|dag| !leaving::has_left(dag));
    Stacks::of(&in_need, present.options).provide_more()?;
    let mut untimed = Untimed::new(&present, &some, plan);
    let mut lead_ns = LEAST_LEAD_NS;
    loop {
        let begun_ns = clock::now_ns();
        let from_ns = since_epoch(begun_ns).saturating_add(lead_ns);
        let mut timed = Timed::new(all(from_ns), present.options);
        if switch(&mut untimed, &mut timed, from_ns) {
            return Ok(from_ns);
        }
        let took_ns = clock::now_ns() - begun_ns;
        lead_ns = lead_ns.max(took_ns).saturating_mul(2);
    }
}

impl Untimed {
    /// Makes room for all DAGs, and puts the bodies of the plan's there.
    fn new(present: &Present, all: &Arc<TaskSet>, plan: Plan) -> Self {
        let known = present.task_set.dags().len();
        let first = DagId(u32::try_from(known).unwrap_or(u32::MAX));
        let cores = this_core::all().len();
        let mut watched = Larger::new(all.vertices(), cores);
        let factor = present.budget_factor;
        for runner in runner::runners(all, first, plan.bodies, factor) {
            watched.placement.replace(runner.vertex, runner);
        }
        for others in runner::others(all, first, plan.others, factor) {
            if let Some(vertex) = others.first().map(|any| any.vertex.index()) {
                watched.others[vertex] = others;
            }
        }
        let mut after_fault = vec![None; known];
        after_fault.extend(plan.after_fault);
        let proven = Proven {
            bounds_ns: plan.bounds_ns,
            sink_bounds_ns: plan.sink_bounds_ns,
        };
        Self {
            watched,
            requests: Requests::larger(present.room, all.dags().len() - known),
            after_fault,
            proven: Arc::new(proven.or_as_before(&present.proven)),
        }
    }
}

impl Timed {
    fn new(task_set: Arc<TaskSet>, options: SchedulerOptions) -> Self {
        Self {
            scheduler: Scheduler::of_cluster(Arc::clone(&task_set), options, ClusterId(0)),
            tally: Journal::empty_tally(&task_set),
            task_set,
        }
    }
}

impl Proven {
    /// Returns what holds for the whole run: the larger one of each bound and that from before.
    fn or_as_before(mut self, before: &Self) -> Self {
        let larger = |(now, before): (&mut Option<u64>, &Option<u64>)| {
            *now = (*now).zip(*before).map(|(now, before)| now.max(before));
        };
        let of_dags = self.bounds_ns.iter_mut().zip(&before.bounds_ns);
        of_dags.for_each(larger);
        let of_dags = self.sink_bounds_ns.iter_mut().zip(&before.sink_bounds_ns);
        of_dags.for_each(|(now, before)| now.iter_mut().zip(before).for_each(larger));
        self
    }
}

/// Goes on with all DAGs, unless the time of the added ones has begun already.
fn switch(untimed: &mut Untimed, timed: &mut Timed, from_ns: u64) -> bool {
    let mut place = cluster::nth(0).execution.lock();
    let Some(execution) = place.as_mut() else {
        return false;
    };
    if since_epoch(clock::now_ns()) > from_ns {
        return false;
    }
    execution.extend(untimed, timed);
    // This is the core that keeps the time.
    let mut woken = CoreSet::default();
    execution.announce(&mut woken);
    drop(place);
    woken.wake();
    true
}

impl Execution {
    fn extend(&mut self, untimed: &mut Untimed, timed: &mut Timed) {
        self.scheduler.extend(&mut timed.scheduler);
        self.watcher.extend(&mut untimed.watched);
        self.watcher.journal.extend(&mut timed.tally);
        swap(&mut self.watcher.task_set, &mut timed.task_set);
        (self.signals).extend(&mut untimed.requests, &mut untimed.after_fault);
        swap(&mut self.proven, &mut untimed.proven);
    }
}
