//! Writes a run's journal, and holds it against the rules.

use std::sync::Arc;

use sched_dag::Recorder;
use sched_dag::journal::What;
use sched_dag::law::{Terms, dispatch_violations, violations};
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
pub(crate) fn judge(
    recorder: &Recorder,
    report: Report,
    task_set: &Arc<TaskSet>,
    options: SchedulerOptions,
) -> Recorded {
    let events = recorder.events.iter().copied();
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
