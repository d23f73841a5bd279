//! Writes a run's journal, and holds it against the rules.

use std::sync::Arc;

use sched_dag::Recorder;
use sched_dag::journal::What;
use sched_dag::law::{Precision, Record, dispatch_violations, violations};
use sched_dag::{CoreId, Instance, SchedulerOptions, TaskSet};

use crate::report::{Recorded, Report};
use crate::watch::Watch;

impl Watch for Recorder {
    const STEP_NS: u64 = 1;

    fn instant(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
    }

    fn started(&mut self, instance: Instance, core: CoreId) {
        self.on_core(What::Start, instance, core);
    }

    fn finished(&mut self, instance: Instance, core: CoreId) {
        self.on_core(What::Finish, instance, core);
    }
}

/// Checks everything.
///
/// # Panics
///
/// If the times do not fit into memory.
pub(crate) fn judge(
    recorder: &Recorder,
    report: Report,
    task_set: &Arc<TaskSet>,
    options: SchedulerOptions,
) -> Recorded {
    let events = recorder.events.iter().copied();
    let record = Record::of_events(task_set, Precision::Exact, true, events.clone());
    let record = record.expect("the times of a run fit into memory; state fewer jobs");
    let of_dispatch = dispatch_violations(task_set, &options, &record, events.clone(), 0);
    let mut by_worker = vec![0; options.cores as usize];
    for event in events.filter(|event| event.what == What::Finish) {
        by_worker[event.core.index()] += 1;
    }
    Recorded {
        report,
        violations: violations(task_set, &record).chain(of_dispatch).collect(),
        instances: by_worker.iter().sum(),
        by_worker,
    }
}
