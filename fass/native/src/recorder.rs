//! Writes a run's journal, and holds it against the rules.

use std::sync::Arc;

use sched_dag::journal::{Event, What};
use sched_dag::law::{Terms, dispatch_violations, violations};
use sched_dag::{CoreId, Scheduler, SchedulerOptions, TaskSet};

use crate::report::{Recorded, Report};

/// Checks everything, of the schedulers of all clusters.
pub(crate) fn judge(
    schedulers: &[Scheduler],
    report: Report,
    task_set: &Arc<TaskSet>,
    options: SchedulerOptions,
) -> Recorded {
    let events = merged(schedulers, task_set, options.cores);
    let events = events.iter().copied();
    let mut found = violations(task_set, Terms::EXACT, events.clone());
    let of_dispatch = dispatch_violations(task_set, &options, Terms::EXACT, events.clone());
    found.extend(of_dispatch);
    let mut by_worker = vec![0; options.cores as usize];
    for event in events.filter(|event| event.what == What::Finish) {
        by_worker[event.core.index()] += 1;
    }
    Recorded {
        report,
        violations: found,
        instances: by_worker.iter().sum(),
        by_worker,
    }
}

/// Returns the events of all clusters, whose schedulers count cores from their first one. Nothing
/// in one depends on another, since each DAG and each core is in one cluster: so any order between
/// them tells the same run, and the law wants that of time.
fn merged(schedulers: &[Scheduler], task_set: &TaskSet, cores: u32) -> Vec<Event> {
    let mut all = Vec::new();
    for (cluster, scheduler) in task_set.clusters().zip(schedulers) {
        let first = task_set.cores_of(cluster, cores).start;
        let mut latest_ns = 0;
        all.extend(scheduler.log.journal.events().map(|event| {
            // What is said of a time before stays where it was said.
            latest_ns = event.time_ns.max(latest_ns);
            let core = CoreId(event.core.0 + first);
            (latest_ns, Event { core, ..event })
        }));
    }
    // It keeps the order within each.
    all.sort_by_key(|&(at_ns, _)| at_ns);
    all.into_iter().map(|(_, event)| event).collect()
}
