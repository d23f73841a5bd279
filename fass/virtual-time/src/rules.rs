//! Rules R1 to R4 of the task model, checked over the records of a run.
//!
//! The check shares nothing with the scheduler: it takes the recorded times and
//! compares them with what the rules say, rule by rule.
//!
//! It is stricter than [`sched_dag::record`], which also judges real machines:
//! in virtual time an instance is ready *at* the instant that the rules give,
//! not merely no earlier.
//!
//! A release that had to queue counts from when it took place. Where an aborted
//! job is involved, "ready exactly when" becomes "not ready before", since an
//! aborted job's instances end without a finish.

use std::collections::BTreeMap;
use std::fmt;

use sched_dag::{DagId, Instance, JobOutcome};

use crate::record::{InstanceRecord, JobRecord};
use crate::report::Report;

/// A rule of the task model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// R1: nothing of a job runs before its release on the nominal grid.
    Release,
    /// R2: an instance is ready exactly when all predecessors and its own
    /// previous job have finished.
    AndJoin,
    /// R3: no effect of an instance before its completion.
    CompletionBoundary,
    /// R4: a job is complete with its last sink, and meets its deadline then.
    JobCompletion,
}

/// A record that breaks a rule.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// The rule.
    pub rule: Rule,
    /// What was recorded and what the rule wants, with names and times.
    pub message: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rule = match self.rule {
            Rule::Release => "R1",
            Rule::AndJoin => "R2",
            Rule::CompletionBoundary => "R3",
            Rule::JobCompletion => "R4",
        };
        write!(f, "{rule}: {}", self.message)
    }
}

/// Checks all records.
pub(crate) fn check(report: &Report) -> Vec<Violation> {
    let check = Check {
        report,
        instances: (report.instances.iter())
            .map(|record| (record.instance, record))
            .collect(),
        jobs: (report.jobs.iter())
            .map(|record| ((record.dag, record.job), record))
            .collect(),
    };
    let mut violations = Vec::new();
    for job in &report.jobs {
        check.job(job, &mut violations);
    }
    for instance in &report.instances {
        check.instance(instance, &mut violations);
    }
    violations
}

struct Check<'r> {
    report: &'r Report,
    instances: BTreeMap<Instance, &'r InstanceRecord>,
    jobs: BTreeMap<(DagId, u64), &'r JobRecord>,
}

impl Check<'_> {
    fn job(&self, record: &JobRecord, violations: &mut Vec<Violation>) {
        let dag = self.report.task_set.dag(record.dag);
        let name = self.report.dag_name(record.dag);
        let JobRecord { job, .. } = *record;
        let grid_ns = dag.offset_ns() + job * dag.period_ns();
        if record.release_ns != grid_ns || record.released_at_ns < grid_ns {
            violations.push(Violation {
                rule: Rule::Release,
                message: format!(
                    "job {job} of `{name}` has release {} ns and was released at {} ns; \
                     the grid says {grid_ns} ns",
                    record.release_ns, record.released_at_ns
                ),
            });
        }
        let (Some(finish_ns), Some(outcome)) = (record.finish_ns, record.outcome) else {
            return;
        };
        if outcome == JobOutcome::Aborted {
            return;
        }
        let finishes = (dag.topological_order().iter())
            .filter(|&&subtask| dag.successors(subtask).is_empty())
            .map(|&subtask| self.finish_ns(record.dag, job, subtask));
        let last_sink_ns = (finishes)
            .reduce(|latest, finish_ns| Some(latest?.max(finish_ns?)))
            .flatten();
        if last_sink_ns != Some(finish_ns) {
            violations.push(Violation {
                rule: Rule::JobCompletion,
                message: format!(
                    "job {job} of `{name}` is complete at {finish_ns} ns, its last sink at \
                     {last_sink_ns:?}"
                ),
            });
        }
        let is_met = finish_ns <= record.release_ns.saturating_add(dag.relative_deadline_ns());
        if is_met != (outcome == JobOutcome::Met) || is_met == record.has_missed {
            violations.push(Violation {
                rule: Rule::JobCompletion,
                message: format!(
                    "job {job} of `{name}`, complete at {finish_ns} ns with its deadline at {} ns, \
                     counts as {outcome:?}",
                    record.deadline_ns
                ),
            });
        }
    }

    fn instance(&self, record: &InstanceRecord, violations: &mut Vec<Violation>) {
        let instance = record.instance;
        let Instance { dag, job, subtask } = instance;
        let name = self.report.subtask_name(instance);
        let mut push = |rule, message| violations.push(Violation { rule, message });
        let Some(of_job) = self.jobs.get(&(dag, job)) else {
            push(
                Rule::Release,
                format!("`{name}` is ready in job {job}, which was not released"),
            );
            return;
        };
        let start_ns = record.start_ns.unwrap_or(u64::MAX);
        if start_ns < of_job.release_ns {
            let release_ns = of_job.release_ns;
            push(
                Rule::Release,
                format!("`{name}` starts job {job} at {start_ns} ns, before {release_ns} ns"),
            );
        }
        let mut expected_ns = of_job.released_at_ns;
        for &predecessor in self.report.task_set.dag(dag).predecessors(subtask) {
            let finish_ns = self.finish_ns(dag, job, predecessor).unwrap_or(u64::MAX);
            if start_ns < finish_ns {
                push(
                    Rule::CompletionBoundary,
                    format!(
                        "`{name}` starts job {job} at {start_ns} ns, while subtask {} finishes \
                         at {finish_ns} ns",
                        predecessor.0
                    ),
                );
            }
            expected_ns = expected_ns.max(finish_ns);
        }
        let mut is_exact = true;
        // The previous job is the one released before: releases may be skipped.
        let earlier = self.jobs.range((dag, 0)..(dag, job)).next_back();
        if let Some((_, previous)) = earlier {
            is_exact = previous.outcome != Some(JobOutcome::Aborted);
            let finish_ns = self.finish_ns(dag, previous.job, subtask);
            expected_ns = expected_ns.max(finish_ns.unwrap_or(if is_exact { u64::MAX } else { 0 }));
        }
        let ready_ns = record.ready_ns;
        if ready_ns < expected_ns || (is_exact && ready_ns > expected_ns) {
            push(
                Rule::AndJoin,
                format!(
                    "`{name}` is ready in job {job} at {ready_ns} ns; all it waits for has \
                     happened at {expected_ns} ns"
                ),
            );
        }
        if start_ns < ready_ns {
            push(
                Rule::AndJoin,
                format!("`{name}` starts job {job} at {start_ns} ns, ready only at {ready_ns} ns"),
            );
        }
    }

    fn finish_ns(&self, dag: DagId, job: u64, subtask: sched_dag::SubtaskId) -> Option<u64> {
        let instance = Instance { dag, job, subtask };
        self.instances.get(&instance)?.finish_ns
    }
}
