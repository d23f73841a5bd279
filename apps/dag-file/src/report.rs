//! The report of a set's run, DAG by DAG, next to the bounds of its commit.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::time::Duration;

use fass::commit::{DagAnswer, SinkAnswer, Verdict};
use fass_dag_file::Set;
use kernel::report::{Distribution, Ns};
use kernel::{Run, json, println};
use sched_dag::law::Violation;
use sched_dag::{DagId, DagStatistics, Instance, SubtaskId};

/// The figures of one set.
pub(crate) struct SetReport {
    set: String,
    dags: Vec<DagReport>,
    violations: usize,
    allocations: u64,
}

struct DagReport {
    name: String,
    subtasks: usize,
    answer: Verdict,
    statistics: DagStatistics,
    responses: Distribution,
    /// For each sink, if there are several.
    sinks: Vec<SinkReport>,
}

struct SinkReport {
    answer: SinkAnswer,
    misses: u64,
    responses: Distribution,
}

impl SetReport {
    /// Collects the figures of a run, and prints each violation.
    pub(crate) fn new(set: &Set, answers: &[DagAnswer], run: &Run) -> Self {
        let dags = set.dags.iter().zip(answers);
        let dags = dags.map(|(dag, answer)| DagReport {
            name: dag.spec.name.clone(),
            subtasks: dag.subtasks.len(),
            answer: answer.verdict.clone(),
            statistics: *run.statistics(answer.dag.id),
            responses: responses(answer.dag.id, run),
            sinks: sinks(answer, run),
        });
        let shown = |violation: &Violation| println!("violation: {violation}");
        Self {
            set: set.name.clone(),
            dags: dags.collect(),
            violations: run.violations().inspect(shown).count(),
            allocations: run.allocations(),
        }
    }

    /// Prints a machine line for each DAG, and another for the set.
    pub(crate) fn emit(&self) {
        for dag in &self.dags {
            json::emit("dag_run", |line| {
                line.text("set", &self.set)
                    .text("dag", &dag.name)
                    .number("subtasks", dag.subtasks as u64)
                    .number("released", dag.statistics.released)
                    .number("completed", dag.statistics.completed)
                    .number("deadline_misses", dag.statistics.misses)
                    .number("skips", dag.statistics.skips)
                    .number("aborts", dag.statistics.aborts)
                    .distribution("response_time_ns", &dag.responses);
                match &dag.answer {
                    Verdict::Proven { test, .. } => {
                        line.number("bound_ns", dag.bound_ns().unwrap_or(0))
                            .text("test", test);
                        if let Some(permille) = dag.tightness_permille() {
                            line.number("tightness_permille", permille);
                        }
                    }
                    Verdict::NotProven(unproven) => {
                        line.text("not_proven", unproven);
                    }
                }
            });
            for sink in &dag.sinks {
                json::emit("dag_sink", |line| {
                    line.text("set", &self.set)
                        .text("dag", &dag.name)
                        .text("sink", &sink.answer.sink.name)
                        .number("relative_deadline_ns", sink.relative_deadline_ns())
                        .number("deadline_misses", sink.misses)
                        .distribution("response_time_ns", &sink.responses);
                    if let Some(bound_ns) = sink.bound_ns() {
                        line.number("bound_ns", bound_ns);
                    }
                });
            }
        }
        json::emit("dag_set", |line| {
            line.text("set", &self.set)
                .number("dags", self.dags.len() as u64)
                .number("violations", self.violations as u64)
                .number("allocations", self.allocations);
        });
    }

    /// Prints the same figures as a table.
    pub(crate) fn print_table(&self) {
        println!();
        if !self.set.is_empty() {
            println!("set {}:", self.set);
        }
        println!(
            "{:<14}{:>6}{:>12}{:>12}{:>12}{:>12}{:>12}{:>10}{:>8}",
            "dag", "jobs", "min", "median", "p99", "max", "bound", "max/bound", "misses"
        );
        for dag in &self.dags {
            let jobs = dag.statistics.completed;
            print_row(
                &dag.name,
                jobs,
                &dag.responses,
                dag.bound_ns(),
                dag.statistics.misses,
            );
            for sink in &dag.sinks {
                let name = format!("  {}", sink.answer.sink.name);
                print_row(&name, jobs, &sink.responses, sink.bound_ns(), sink.misses);
            }
        }
        for dag in &self.dags {
            if let Verdict::NotProven(unproven) = &dag.answer {
                println!("no bound for `{}`: {unproven}", dag.name);
            }
        }
        println!("{} violations", self.violations);
    }

    /// Returns the reason that makes the run a failure, if any.
    pub(crate) fn complaint(&self, is_strict: bool) -> Option<String> {
        if self.violations > 0 {
            return Some(format!(
                "set `{}`: {} violations",
                self.set, self.violations
            ));
        }
        let late = self.dags.iter().find(|dag| dag.statistics.misses > 0);
        let late = late.filter(|_| is_strict)?;
        let (name, misses) = (&late.name, late.statistics.misses);
        Some(format!(
            "dag `{name}` missed {misses} deadlines, and none may be missed"
        ))
    }
}

impl DagReport {
    fn bound_ns(&self) -> Option<u64> {
        in_ns(self.answer.bound()?)
    }

    fn tightness_permille(&self) -> Option<u64> {
        tightness_permille(&self.responses, self.bound_ns()?)
    }
}

impl SinkReport {
    fn bound_ns(&self) -> Option<u64> {
        in_ns(self.answer.bound?)
    }

    fn relative_deadline_ns(&self) -> u64 {
        in_ns(self.answer.relative_deadline).unwrap_or(u64::MAX)
    }
}

fn in_ns(time: Duration) -> Option<u64> {
    u64::try_from(time.as_nanos()).ok()
}

/// Returns the longest response time in thousandths of the bound.
fn tightness_permille(responses: &Distribution, bound_ns: u64) -> Option<u64> {
    let longest = u128::from(responses.max()) * 1000;
    let permille = longest.checked_div(u128::from(bound_ns))?;
    u64::try_from(permille).ok()
}

fn print_row(name: &str, jobs: u64, times: &Distribution, bound_ns: Option<u64>, misses: u64) {
    let none = || "-".to_string();
    let tightness = bound_ns.and_then(|bound_ns| tightness_permille(times, bound_ns));
    println!(
        "{:<14}{:>6}{:>12}{:>12}{:>12}{:>12}{:>12}{:>10}{:>8}",
        name,
        jobs,
        Ns(times.min()),
        Ns(times.median()),
        Ns(times.p99()),
        Ns(times.max()),
        bound_ns.map_or_else(none, |ns| Ns(ns).to_string()),
        tightness.map_or_else(none, percent),
        misses
    );
}

fn percent(permille: u64) -> String {
    format!("{}.{} %", permille / 10, permille % 10)
}

/// Returns the response times of all completed jobs.
fn responses(dag: DagId, run: &Run) -> Distribution {
    if run.record().first_job(dag) > 0
        && let Some(times) = run.times()
    {
        return times.dag(dag).response_time.distribution();
    }
    Distribution::new(run.response_times_ns(dag))
}

/// Returns the figures of a DAG's sinks, if there are several.
fn sinks(answer: &DagAnswer, run: &Run) -> Vec<SinkReport> {
    let dag = answer.dag.id;
    if answer.sinks.len() < 2 {
        return Vec::new();
    }
    let report = |answer: &SinkAnswer| SinkReport {
        answer: answer.clone(),
        misses: run.sink_misses(dag, answer.sink.id),
        responses: sink_responses(dag, answer.sink.id, run),
    };
    answer.sinks.iter().map(report).collect()
}

/// Returns the response times of a sink in all jobs with a finished sink.
fn sink_responses(dag: DagId, subtask: SubtaskId, run: &Run) -> Distribution {
    let vertex = |job| run.task_set().vertex(Instance { dag, job, subtask });
    if run.record().first_job(dag) > 0
        && let Some(times) = run.times()
        && let Some(response_time) = &times.subtask(vertex(0)).response_time
    {
        return response_time.distribution();
    }
    let jobs = run.record().numbered(dag);
    Distribution::new(jobs.filter_map(|(job, times)| {
        let sink = run.record().instance(Instance { dag, job, subtask })?;
        Some(sink.finish_ns?.saturating_sub(times.release_ns?))
    }))
}
