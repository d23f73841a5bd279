//! Writes a run down, and holds it against the rules.

use std::sync::Arc;

use sched_dag::record::{Precision, Record, Stretch, dispatch_violations, violations};
use sched_dag::{CoreId, DagId, Instance, JobOutcome, Observer, SchedulerOptions, TaskSet};

use crate::run::{Recorded, Report};
use crate::watch::Watch;

/// Writes down when what happened, on the scheduler's clock.
#[derive(Debug)]
pub(crate) struct Recorder {
    record: Record,
    now_ns: u64,
    stretches: Vec<Stretch>,
}

impl Recorder {
    pub(crate) fn new(task_set: &TaskSet) -> Self {
        let jobs = |dag| task_set.dag(dag).jobs().unwrap_or(0);
        let record = Record::with_jobs(task_set, Precision::Exact, jobs);
        Self {
            record: record.expect("the record of a run fits into memory; state fewer jobs"),
            now_ns: 0,
            stretches: Vec::new(),
        }
    }

    /// Checks everything.
    pub(crate) fn finish(
        self,
        report: Report,
        task_set: &Arc<TaskSet>,
        options: SchedulerOptions,
    ) -> Recorded {
        let of_dispatch = dispatch_violations(task_set, &options, &self.record, &self.stretches);
        let mut by_worker = vec![0; options.cores as usize];
        let mut instances = 0;
        for (_, times) in self.record.all_instances(task_set) {
            if let (Some(core), Some(_)) = (times.core, times.finish_ns) {
                by_worker[core.index()] += 1;
                instances += 1;
            }
        }
        Recorded {
            report,
            violations: violations(task_set, &self.record)
                .chain(of_dispatch)
                .collect(),
            instances,
            by_worker,
        }
    }
}

impl Watch for Recorder {
    const STEP_NS: u64 = 1;

    fn instant(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
    }

    fn started(&mut self, instance: Instance, core: CoreId) {
        if let Some(times) = self.record.instance_mut(instance) {
            times.start_ns = Some(self.now_ns);
            times.core = Some(core);
        }
    }

    fn finished(&mut self, instance: Instance, core: CoreId) {
        let Some(times) = self.record.instance_mut(instance) else {
            return;
        };
        times.finish_ns = Some(self.now_ns);
        times.runs += 1;
        self.stretches.extend(times.start_ns.map(|from_ns| Stretch {
            instance,
            core,
            from_ns,
            to_ns: self.now_ns,
        }));
    }
}

impl Observer for Recorder {
    fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        if let Some(of_job) = self.record.job_mut(dag, job) {
            of_job.release_ns = Some(release_ns);
            of_job.released_ns = Some(self.now_ns);
        }
    }

    fn ready(&mut self, instance: Instance) {
        if let Some(times) = self.record.instance_mut(instance) {
            times.ready_ns = Some(self.now_ns);
        }
    }

    fn aborted(&mut self, dag: DagId, job: u64) {
        if let Some(of_job) = self.record.job_mut(dag, job) {
            of_job.cut_ns = Some(self.now_ns);
        }
    }

    fn deadline_missed(&mut self, dag: DagId, job: u64, deadline_ns: u64) {
        if let Some(of_job) = self.record.job_mut(dag, job) {
            of_job.missed_ns = Some(deadline_ns);
        }
    }

    fn job_completed(&mut self, dag: DagId, job: u64, outcome: JobOutcome) {
        if let Some(of_job) = self.record.job_mut(dag, job) {
            of_job.ended_ns = Some(self.now_ns);
            of_job.outcome = Some(outcome);
        }
    }
}
