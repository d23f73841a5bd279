//! What a person may ask of a run, and change in it, while it goes on.
//!
//! To be called by core 0's background. Each question and each change holds a
//! cluster's lock for a bounded time; nothing is allocated.

use alloc::sync::Arc;

use sched_dag::{Dag, DagId, DagStatistics, Moment, Scheduler, TaskSet};

use super::core_set::CoreSet;
use super::{cluster, divided};
use crate::machine::clock;
use crate::machine::timer::{self, Alarm};

/// A change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// The DAG's due jobs are skipped.
    Pause(DagId),
    /// The DAG's due jobs are released again.
    Resume(DagId),
    /// The DAG releases no further job.
    Close(DagId),
}

impl Control {
    const fn dag(self) -> DagId {
        match self {
            Self::Pause(dag) | Self::Resume(dag) | Self::Close(dag) => dag,
        }
    }

    /// Tells the scheduler.
    pub(super) fn apply(self, moment: &mut Moment<'_>) {
        match self {
            Self::Pause(dag) => moment.pause(dag),
            Self::Resume(dag) => moment.resume(dag),
            Self::Close(dag) => moment.close(dag),
        }
    }
}

/// Whether a DAG releases jobs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// It does.
    Running,
    /// It skips them until it is resumed.
    Paused,
    /// It never will, because of a fault or a shutdown.
    Ended,
    /// All that it had to release has ended.
    Over,
}

/// A DAG at one instant.
#[derive(Clone, Copy, Debug)]
pub struct Snapshot {
    /// What it does now.
    pub state: State,
    /// What has become of its jobs.
    pub statistics: DagStatistics,
    /// Jobs in flight.
    pub in_flight: u64,
    /// Due jobs that wait for an older one to end.
    pub waiting: u64,
}

/// Returns the model of the run, if one goes on.
pub fn task_set() -> Option<Arc<TaskSet>> {
    let place = cluster::nth(0).execution.lock();
    place.as_ref().map(|execution| execution.task_set().clone())
}

/// Returns how a DAG does, if a run goes on that has it.
pub fn snapshot(dag: DagId) -> Option<Snapshot> {
    let place = divided::of_dag(dag).execution.lock();
    let scheduler = &place.as_ref()?.engine.scheduler;
    scheduler.task_set().dags().get(dag.index())?;
    Some(Snapshot::of(scheduler, dag))
}

impl Snapshot {
    /// Looks at a DAG.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    pub fn of(scheduler: &Scheduler, dag: DagId) -> Self {
        let has_limit = scheduler.task_set().dag(dag).jobs().is_some();
        let state = if scheduler.is_closed(dag) {
            State::Ended
        } else if scheduler.is_over(dag) && has_limit {
            State::Over
        } else if scheduler.is_paused(dag) {
            State::Paused
        } else {
            State::Running
        };
        Self {
            state,
            statistics: *scheduler.statistics(dag),
            in_flight: scheduler.in_flight(dag),
            waiting: scheduler.waiting(dag),
        }
    }
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

/// Makes a change, in a step of the scheduler.
pub fn control(control: Control) {
    let cluster = divided::of_dag(control.dag());
    let mut place = cluster.execution.lock();
    let Some(execution) = place.as_mut() else {
        return;
    };
    let mut woken = CoreSet::default();
    cluster::among(cluster, || {
        execution.step(clock::now_ns(), &mut woken, |moment| control.apply(moment))
    });
    drop(place);
    woken.wake();
    // The step may want this core, too, which follows at its next interrupt.
    timer::set(Alarm::Schedule, clock::now_ns());
}
