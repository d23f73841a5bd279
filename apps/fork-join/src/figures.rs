//! Figures of a fork-join run: its latencies and its counts.

use alloc::format;
use alloc::string::String;

use fass::Dag;
use fork_join::JoinCount;
use kernel::report::{Distribution, Ns};
use kernel::{Run, json, println};
use sched_dag::Instance;

/// The names of the latencies, in the table and in the machine line.
const LATENCIES: [(&str, &str); 4] = [
    ("join latency", "join_latency_ns"),
    ("join to start", "join_to_start_ns"),
    ("response time", "response_time_ns"),
    ("release jitter", "release_jitter_ns"),
];

/// The figures of one run.
pub(crate) struct RunFigures {
    parallel: usize,
    jobs: u64,
    joins: u64,
    violations: u64,
    deadline_misses: u64,
    allocations: u64,
    first_release_ns: u64,
    /// The first job whose times are still recorded.
    first_recorded_job: u64,
    /// In the order of [`LATENCIES`].
    latencies: [Distribution; 4],
}

impl RunFigures {
    pub(crate) fn new(parallel: usize, run: &Run, dag: &Dag, joins: &JoinCount) -> Self {
        let (record, dag) = (run.record(), run.task_set().find(dag));
        let jobs = record.numbered(dag);
        let subtask = run.task_set().dag(dag).sinks()[0];
        let sinks = jobs.clone().filter_map(|(job, _)| {
            let instance = Instance { dag, job, subtask };
            Some((
                record.join_ns(run.task_set(), instance)?,
                *record.instance(instance)?,
            ))
        });
        let since = |later: Option<u64>, earlier: u64| Some(later?.saturating_sub(earlier));
        // From the last parallel subtask's finish to the sink being ready.
        let to_ready = (sinks.clone()).filter_map(|(join, sink)| since(sink.ready_ns, join));
        // From the same finish to the sink's first instruction.
        let to_start = sinks.filter_map(|(join, sink)| since(sink.start_ns, join));
        // From the nominal release to the completion.
        let responses = jobs
            .clone()
            .filter_map(|(job, times)| since(record.completion_ns(dag, job), times.release_ns?));
        // From the nominal release to the release.
        let jitter = jobs.filter_map(|(_, times)| since(times.released_ns, times.release_ns?));
        let statistics = run.statistics(dag);
        let found = run
            .violations()
            .inspect(|violation| println!("violation: {violation}"));
        Self {
            parallel,
            jobs: statistics.completed,
            joins: joins.total(),
            violations: found.count() as u64 + joins.mixed(),
            deadline_misses: statistics.misses,
            allocations: run.allocations(),
            first_release_ns: run.epoch_ns(),
            first_recorded_job: record.first_job(dag),
            latencies: [
                Distribution::new(to_ready),
                Distribution::new(to_start),
                Distribution::new(responses),
                Distribution::new(jitter),
            ],
        }
    }

    /// Prints the figures as a machine line.
    pub(crate) fn emit(&self) {
        json::emit("fork_join", |line| {
            line.number("subtasks", self.parallel as u64)
                .number("jobs", self.jobs)
                .number("joins", self.joins)
                .number("violations", self.violations);
            for ((_, member), times) in LATENCIES.iter().zip(&self.latencies) {
                line.distribution(member, times);
            }
            line.number("deadline_misses", self.deadline_misses)
                .number("allocations", self.allocations)
                .number("first_release_ns", self.first_release_ns);
        });
    }

    /// Prints the figures as a table.
    pub(crate) fn print_table(&self) {
        println!(
            "N = {}: {} jobs, {} joins, {} semantic violations, {} deadline misses, {} allocations",
            self.parallel,
            self.jobs,
            self.joins,
            self.violations,
            self.deadline_misses,
            self.allocations
        );
        if self.first_recorded_job > 0 {
            println!(
                "  of the jobs from {} on; `events=on` keeps the statistics of all",
                self.first_recorded_job
            );
        }
        println!(
            "  {:<16}{:>12}{:>12}{:>12}{:>12}",
            "", "min", "median", "p99", "max"
        );
        for ((name, _), times) in LATENCIES.iter().zip(&self.latencies) {
            println!(
                "  {name:<16}{:>12}{:>12}{:>12}{:>12}",
                Ns(times.min()),
                Ns(times.median()),
                Ns(times.p99()),
                Ns(times.max())
            );
        }
    }

    /// Returns a complaint about the run, if anything is wrong.
    pub(crate) fn complaint(&self) -> Option<String> {
        let (jobs, joins) = (self.jobs, self.joins);
        let wrong = match (self.violations, self.allocations) {
            (count @ 1.., _) => format!("{count} semantic violations"),
            _ if jobs != joins => format!("{jobs} jobs but {joins} joins"),
            (_, count @ 1..) => format!("{count} allocations while running"),
            _ => return None,
        };
        Some(format!("N = {}: {wrong}", self.parallel))
    }
}
