//! Figures of a fork-join run: its latencies and its counts.

use alloc::format;
use alloc::string::String;

use fass::Dag;
use fork_join::Joins;
use kernel::report::{Distribution, Ns};
use kernel::{Run, json, println};
use sched_dag::Instance;

/// The figures of one run.
pub(crate) struct Figures {
    parallel: usize,
    jobs: u64,
    joins: u64,
    violations: u64,
    deadline_misses: u64,
    allocations: u64,
    first_release_ns: u64,
    /// The first job of which the times are left.
    first_recorded_job: u64,
    /// From the last parallel subtask's finish to the sink being ready.
    join_latency: Distribution,
    /// From the last parallel subtask's finish to the sink's first instruction.
    join_to_start: Distribution,
    /// From the nominal release to the completion.
    response_time: Distribution,
    /// From the nominal release to the release.
    release_jitter: Distribution,
}

impl Figures {
    pub(crate) fn new(parallel: usize, run: &Run, dag: &Dag, joins: &Joins) -> Self {
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
        let releases = jobs;
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
            join_latency: Distribution::new(
                sinks
                    .clone()
                    .filter_map(|(join, sink)| since(sink.ready_ns, join)),
            ),
            join_to_start: Distribution::new(
                sinks.filter_map(|(join, sink)| since(sink.start_ns, join)),
            ),
            response_time: Distribution::new(releases.clone().filter_map(|(job, times)| {
                since(record.completion_ns(dag, job), times.release_ns?)
            })),
            release_jitter: Distribution::new(
                releases.filter_map(|(_, times)| since(times.released_ns, times.release_ns?)),
            ),
        }
    }

    /// Prints the figures as a machine line.
    pub(crate) fn emit(&self) {
        json::emit("fork_join", |line| {
            line.number("subtasks", self.parallel as u64)
                .number("jobs", self.jobs)
                .number("joins", self.joins)
                .number("violations", self.violations)
                .distribution("join_latency_ns", &self.join_latency)
                .distribution("join_to_start_ns", &self.join_to_start)
                .distribution("response_time_ns", &self.response_time)
                .distribution("release_jitter_ns", &self.release_jitter)
                .number("deadline_misses", self.deadline_misses)
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
        for (name, distribution) in [
            ("join latency", &self.join_latency),
            ("join to start", &self.join_to_start),
            ("response time", &self.response_time),
            ("release jitter", &self.release_jitter),
        ] {
            println!(
                "  {name:<16}{:>12}{:>12}{:>12}{:>12}",
                Ns(distribution.min()),
                Ns(distribution.median()),
                Ns(distribution.p99()),
                Ns(distribution.max())
            );
        }
    }

    /// Says what is wrong with the run, if anything is.
    pub(crate) fn complaint(&self) -> Option<String> {
        let Self {
            parallel,
            jobs,
            joins,
            violations,
            allocations,
            ..
        } = self;
        if *violations > 0 {
            return Some(format!("N = {parallel}: {violations} semantic violations"));
        }
        if jobs != joins {
            return Some(format!("N = {parallel}: {jobs} jobs but {joins} joins"));
        }
        (*allocations > 0)
            .then(|| format!("N = {parallel}: {allocations} allocations while running"))
    }
}
