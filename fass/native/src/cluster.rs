//! A run of one cluster: its scheduler, its workers, and nothing that another one writes.
//!
//! Its first worker makes all that, so that it lies in memory that the thread has for itself.

use std::sync::Arc;
use std::thread;

use sched_dag::{ClusterId, CoreId, Journal, Scheduler, SchedulerOptions, TaskSet};

use crate::execute::Execute;
use crate::others::Others;
use crate::reports::Reports;
use crate::start::Start;
use crate::watch::Watch;
use crate::{alone, team};

/// Which cluster of what.
#[derive(Clone, Copy)]
pub(crate) struct Place<'a> {
    pub(crate) task_set: &'a Arc<TaskSet>,
    /// Those of the whole machine.
    pub(crate) options: SchedulerOptions,
    pub(crate) cluster: ClusterId,
    pub(crate) start: &'a Start,
}

/// Runs all jobs of the cluster's DAGs to their ends; the calling thread is its first worker.
pub(crate) fn run<B: Execute, W: Watch, O: Others>(
    place: Place<'_>,
    mut bodies: Vec<B>,
    others: O,
) -> Scheduler {
    let _end = EndOnPanic(others);
    let Place {
        task_set, start, ..
    } = place;
    let mut cores = task_set.cores_of(place.cluster, place.options.cores);
    let first = cores.start;
    let mut scheduler = Scheduler::of_cluster(Arc::clone(task_set), place.options, place.cluster);
    if W::STEP_NS > 0 {
        scheduler.log.journal = Journal::growing();
    }
    if cores.len() == 1 {
        let mut reports = Reports::new(&mut scheduler, &mut bodies[..]);
        start.ready(first);
        alone::run::<B, W>(&mut scheduler, &mut reports, others);
        return scheduler;
    }
    let team = team::Team::<B, W, O>::new(scheduler, bodies, others);
    let work = |worker| {
        let _end = EndOnPanic(others);
        start.ready(worker);
        team.work(CoreId(worker - first));
    };
    cores.next();
    thread::scope(|scope| {
        let others: Vec<_> = cores
            .map(|worker| scope.spawn(move || work(worker)))
            .collect();
        work(first);
        others.into_iter().for_each(join);
    });
    team.into_parts()
}

/// Waits for a thread's end, and passes its panic on.
pub(crate) fn join<T>(thread: thread::ScopedJoinHandle<'_, T>) -> T {
    match thread.join() {
        Ok(result) => result,
        Err(panic) => std::panic::resume_unwind(panic),
    }
}

/// Ends the run of all clusters if a worker panics.
struct EndOnPanic<O: Others>(O);

impl<O: Others> Drop for EndOnPanic<O> {
    fn drop(&mut self) {
        if thread::panicking() {
            self.0.end();
        }
    }
}
