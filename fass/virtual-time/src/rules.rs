//! Rules R1 to R5 of the task model, checked over a run.
//!
//! The checks are `sched_dag::record`'s, the same that judge a run of the
//! kernel; here a report is put into their form. Times in virtual time are
//! exact, so everything has to happen *at* the instant that the rules give, and
//! at every instant the right instances must run.

use std::collections::BTreeMap;

use sched_dag::record::{
    InstanceRecord, JobRecord, Precision, Record, Stretch, Violation, dispatch_violations,
    violations,
};
use sched_dag::{Instance, JobOutcome};

use crate::event::EventKind;
use crate::report::Report;

/// Returns all breaches of the rules in a report.
///
/// # Panics
///
/// If the record does not fit into memory a second time.
pub(crate) fn check(report: &Report) -> Vec<Violation> {
    let record = record(report).expect("the report's jobs fit into memory");
    let stretches = stretches(report);
    let of_dispatch = dispatch_violations(&report.task_set, &report.options, &record, &stretches);
    violations(&report.task_set, &record)
        .chain(of_dispatch)
        .collect()
}

/// Returns the report's times as a record, `None` if they do not fit.
pub(crate) fn record(report: &Report) -> Option<Record> {
    // Skipped jobs have places, too: job numbers are positions.
    let mut jobs = vec![0; report.task_set.dags().len()];
    let of_jobs = report.jobs.iter().map(|of_job| (of_job.dag, of_job.job));
    let of_instances = report.instances.iter().map(|times| times.instance);
    for (dag, job) in of_jobs.chain(of_instances.map(|instance| (instance.dag, instance.job))) {
        jobs[dag.index()] = jobs[dag.index()].max(job + 1);
    }
    let task_set = &report.task_set;
    let mut record = Record::with_jobs(task_set, Precision::Exact, |dag| jobs[dag.index()])?;
    for of_job in &report.jobs {
        *record.job_mut(of_job.dag, of_job.job)? = JobRecord {
            release_ns: Some(of_job.release_ns),
            released_ns: Some(of_job.released_at_ns),
            missed_ns: of_job.has_missed.then_some(of_job.deadline_ns),
            ended_ns: of_job.finish_ns,
            outcome: of_job.outcome,
            ..JobRecord::default()
        };
    }
    for times in &report.instances {
        *record.instance_mut(times.instance)? = InstanceRecord {
            ready_ns: Some(times.ready_ns),
            start_ns: times.start_ns,
            finish_ns: times.finish_ns,
            failed_ns: times.failed_ns,
            core: times.core,
            preemptions: times.preemptions,
            ..InstanceRecord::default()
        };
    }
    for event in &report.events {
        match event.kind {
            EventKind::Aborted { dag, job } => {
                record.job_mut(dag, job)?.cut_ns = Some(event.time_ns);
            }
            EventKind::DagEnded { dag } => {
                let of_dag = report.jobs.iter().filter(|of_job| of_job.dag == dag);
                for of_job in of_dag.filter(|of_job| was_cut_short(of_job.outcome)) {
                    record
                        .job_mut(dag, of_job.job)?
                        .cut_ns
                        .get_or_insert(event.time_ns);
                }
            }
            EventKind::Finished { instance, .. } => record.instance_mut(instance)?.runs += 1,
            _ => {}
        }
    }
    Some(record)
}

/// Reports whether a job of a DAG that was ended was in flight then: such a job
/// ends as that, or has not ended yet.
fn was_cut_short(outcome: Option<JobOutcome>) -> bool {
    matches!(outcome, None | Some(JobOutcome::DagEnded))
}

/// Returns when which core ran what. What still runs at the end has no end.
fn stretches(report: &Report) -> Vec<Stretch> {
    let mut open: BTreeMap<Instance, Stretch> = BTreeMap::new();
    let mut stretches = Vec::new();
    for event in &report.events {
        let time_ns = event.time_ns;
        match event.kind {
            EventKind::Started { instance, core } | EventKind::Resumed { instance, core } => {
                let begun = Stretch {
                    instance,
                    core,
                    from_ns: time_ns,
                    to_ns: u64::MAX,
                };
                stretches.extend(open.insert(instance, begun));
            }
            EventKind::Preempted { instance, .. }
            | EventKind::Finished { instance, .. }
            | EventKind::Failed { instance, .. } => {
                let ended = open.remove(&instance);
                stretches.extend(ended.map(|begun| Stretch {
                    to_ns: time_ns,
                    ..begun
                }));
            }
            _ => {}
        }
    }
    stretches.extend(open.into_values());
    stretches
}
