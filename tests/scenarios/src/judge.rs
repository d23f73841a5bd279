//! Compares runs with their scenarios.

use alloc::string::String;
use alloc::vec::Vec;
use alloc::{format, vec};

use core::sync::atomic::Ordering::Relaxed;

use fass::OverrunPolicy;
use fass::commit::{Commit, CommitError};
use sched_dag::engine::Run;
use sched_dag::law::RunRecord;
use sched_dag::{DagId, DagStatistics, JobOutcome, TaskSet};

use crate::dag::Use;
use crate::{BYSTANDER, Calls, Scenario, UNIT_NS};

impl Scenario {
    /// Compares DAGs' statistics with the lines `everywhere` and, if `is_exact`, with the lines for
    /// virtual time, too. Returns the differences, a line each.
    pub fn judge_counts<'a>(
        &self,
        task_set: &TaskSet,
        statistics: impl Fn(DagId) -> &'a DagStatistics,
        is_exact: bool,
    ) -> Vec<String> {
        let exactly = self.exactly.iter().filter(|_| is_exact);
        let mut wrong = vec![];
        for line in self.everywhere.iter().chain(exactly) {
            let (name, counts) = line.split_once(": ").unwrap_or((line, ""));
            let Some(dag) = task_set.dags().iter().position(|dag| dag.name() == name) else {
                wrong.push(format!("`{line}`: there is no dag `{name}`"));
                continue;
            };
            let dag = DagId(u32::try_from(dag).unwrap_or(u32::MAX));
            let all = format!("{:?},", statistics(dag)).replace(" }", ",");
            for count in counts.split_whitespace() {
                let (counter, expected) = count.split_once('=').unwrap_or((count, ""));
                let found = all.split_once(&format!(" {counter}: "));
                let found = found.map(|(_, rest)| rest.split(',').next().unwrap_or_default());
                if found != Some(expected) {
                    let found = found.unwrap_or("unknown");
                    wrong.push(format!("{name}: {counter} is {found}, and not {expected}"));
                }
            }
        }
        wrong
    }

    /// Compares each DAG's counters with each other, with the record, and with the functions' own
    /// counts. The scenario must have no requested end. Returns the broken claims, a line each.
    #[allow(clippy::too_many_lines, reason = "a list of claims")]
    pub fn judge_accounts<'a>(
        &self,
        task_set: &TaskSet,
        record: &RunRecord,
        statistics: impl Fn(DagId) -> &'a DagStatistics,
    ) -> Vec<String> {
        let pauses = |name: &String| {
            let mut subtasks = self.dags.iter().flat_map(|dag| &dag.subtasks);
            let mut modes = self.modes.iter();
            subtasks.any(|of| matches!(&of.uses, Use::Switches(other, _) if other == name))
                || modes.any(|(_, dags)| dags.contains(name))
        };
        let (mut wrong, mut all_faults) = (vec![], 0);
        for (id, text) in (0..).map(DagId).zip(&self.dags) {
            let counts = statistics(id);
            let DagStatistics {
                released,
                completed,
                skips,
                aborts,
                faults,
                restarts,
                failed,
                cut_short,
                ..
            } = *counts;
            let recorded = |outcome| {
                let outcomes = record.jobs(id).iter().map(|job| job.outcome);
                outcomes.filter(|of| *of == Some(outcome)).count() as u64
            };
            let late = recorded(JobOutcome::Missed);
            let may_skip = text.overrun != OverrunPolicy::Queue || pauses(&text.name);
            let are_all_to_run = !may_skip && !text.is_sporadic;
            let to_fail = text.subtasks.iter().map(|of| of.fails.len() as u64).sum();
            let is_ended = faults > restarts;
            all_faults += faults;
            let due = released + skips;
            let jobs = if text.is_sporadic { due } else { text.jobs };
            let claims = [
                (
                    "each job is released or skipped",
                    jobs == due || is_ended && jobs > due,
                ),
                (
                    "each released job is completed, aborted, or lost by a fault",
                    released == completed + aborts + failed + cut_short,
                ),
                (
                    "completed jobs are recorded as such",
                    completed == recorded(JobOutcome::Met) + late,
                ),
                (
                    "aborted jobs are recorded as such",
                    aborts == recorded(JobOutcome::Aborted),
                ),
                (
                    "lost jobs are recorded as such",
                    failed == recorded(JobOutcome::Failed)
                        && cut_short == recorded(JobOutcome::DagEnded),
                ),
                (
                    "late jobs are misses",
                    (late..=jobs).contains(&counts.misses),
                ),
                (
                    "jobs are skipped only if that is allowed",
                    skips == 0 || may_skip,
                ),
                (
                    "jobs are aborted only if that is allowed",
                    aborts == 0 || text.overrun == OverrunPolicy::Abort,
                ),
                (
                    "jobs wait only if that is allowed",
                    counts.queued == 0 || text.overrun != OverrunPolicy::Skip,
                ),
                (
                    "each call that is to fail does so, if it is made",
                    faults == to_fail || faults < to_fail && !are_all_to_run,
                ),
                (
                    "the DAG goes on after a fault that it survives, and after no other",
                    restarts == text.survives.map_or(0, |_| faults) && failed <= restarts,
                ),
                (
                    "a DAG that goes on loses nothing else",
                    is_ended || cut_short + counts.dropped == 0,
                ),
            ];
            let broken = claims.iter().filter(|(_, holds)| !holds);
            wrong.extend(broken.map(|(claim, _)| {
                format!("{}: it does not hold that {claim}: {counts:?}", text.name)
            }));
        }
        let instances = record.all_instances(task_set);
        let runs: u64 = instances.map(|(_, times)| u64::from(times.runs)).sum();
        let Calls { returned, failed } = &*self.calls;
        let (returned, failed) = (returned.load(Relaxed), failed.load(Relaxed));
        if (returned, failed) != (runs, all_faults) {
            wrong.push(format!(
                "{returned} calls returned and {failed} failed, {runs} and {all_faults} are known"
            ));
        }
        wrong
    }

    /// Compares a run in real time with the lines `everywhere` and with R1 to R4, and looks for
    /// allocations after the commit. Returns the differences, a line each.
    #[must_use]
    pub fn judge_run(&self, run: &Run) -> Vec<String> {
        let mut wrong = self.judge_counts(run.task_set(), |dag| run.statistics(dag), false);
        wrong.extend(run.violations().map(|it| format!("{it:?}")));
        // A panic on Linux is unwound, for which it allocates.
        let mut subtasks = self.dags.iter().flat_map(|dag| &dag.subtasks);
        let fails = subtasks.any(|subtask| !subtask.fails.is_empty());
        if run.allocations() > 0 && !fails {
            wrong.push(format!("{} allocations", run.allocations()));
        }
        wrong
    }

    /// Compares a virtual-time run's events, given as the report's lines, with the timeline.
    /// Returns both if they differ.
    #[must_use]
    pub fn judge_events(&self, lines: &[String]) -> Vec<String> {
        let mut expected = vec![];
        for line in &self.timeline {
            let (time, events) = line.split_once(' ').unwrap_or((line, ""));
            let events = events.split(", ");
            expected.extend(events.map(|event| format!("{time} {event}")));
        }
        let is_meant = |line: &str| {
            let same = |of: &String| kind(of) == kind(line);
            let is_told =
                expected.iter().any(same) || self.never.iter().any(|never| never == kind(line));
            is_told && !line.contains(BYSTANDER)
        };
        let mut happened: Vec<String> = lines.iter().map(|line| in_units(line)).collect();
        happened.retain(|line| is_meant(line));
        let is_same = |(told, of): (&String, &String)| {
            let without_core = told.split_once(" core ").map(|(told, _)| told);
            told == of || without_core == Some(of)
        };
        let is_right =
            happened.len() == expected.len() && happened.iter().zip(&expected).all(is_same);
        match is_right {
            true => vec![],
            false => vec![
                format!("expected:\n  {}", expected.join("\n  ")),
                format!("happened:\n  {}", happened.join("\n  ")),
            ],
        }
    }

    /// Compares a commit with the scenario's `refused` line. Returns `None` if the commit is
    /// accepted, as it should be; then the run follows.
    #[must_use]
    pub fn judge_commit(&self, commit: Result<Commit, CommitError>) -> Option<Vec<String>> {
        let refusal = commit.err();
        let faults = refusal.iter().flat_map(CommitError::faults);
        let codes: Vec<&str> = faults.map(fass::commit::Fault::code).collect();
        match &refusal {
            _ if codes != self.refused => {
                Some(vec![format!("the commit is refused for {codes:?}")])
            }
            None => None,
            Some(_) => Some(vec![]),
        }
    }
}

/// Returns the kind of a line's event.
fn kind(line: &str) -> &str {
    line.split(' ').nth(1).unwrap_or_default()
}

/// Returns a line with its time in units of 1 ms; a deadline is missed a nanosecond later, `N+`.
fn in_units(line: &str) -> String {
    let (time_ns, event) = line.split_once(' ').unwrap_or((line, ""));
    let time_ns: u64 = time_ns.parse().unwrap_or(u64::MAX);
    match (time_ns / UNIT_NS, time_ns % UNIT_NS) {
        (time, 0) => format!("{time} {event}"),
        (time, 1) => format!("{time}+ {event}"),
        _ => line.into(),
    }
}
