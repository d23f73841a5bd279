//! Boots into one condition of the evaluation, and prints the times of all jobs.
//!
//! The DAG-native condition runs the DAG of `fork-join`, joined by the scheduler. The other
//! conditions run callbacks, and a synchronizer matches their messages (`by_stamps`). The app
//! prints all times in batches, and a summary.

#![no_std]
#![no_main]

extern crate alloc;

mod by_stamps;

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::num::NonZeroUsize;

use by_stamps::{Experiment, MatchingPolicy};
use fass::Occupation;
use fork_join::{ExecutionWork, MOST_PARALLEL, Workload};
use join_latency::{CompletedJoin, ExecutionSpan, RunSamples};
use kernel::options::UsageError;
use kernel::report::{Distribution, Ns};
use kernel::{AppError, Machine, Run, json, println};
use sched_dag::law::InstanceRecord;
use sched_dag::{Instance, SubtaskId};

kernel::entry!(main);

/// The app's options on the command line.
const WORDS: [&str; 7] = [
    "policy_under_test",
    "max_interval_ms",
    "subtasks",
    "jobs",
    "seed",
    "queue",
    "depth",
];

#[allow(clippy::too_many_lines, reason = "the app's steps, in order")]
fn main(machine: &Machine) -> Result<(), AppError> {
    let options = machine.options();
    let max_interval_ms = options.number("max_interval_ms", 1..=1_000_000, 50)?;
    let max_interval_ns = max_interval_ms * 1_000_000;
    let policies = [
        ("fass", None),
        ("exact", Some(MatchingPolicy::Exact)),
        (
            "approximate",
            Some(MatchingPolicy::Approximate { max_interval_ns }),
        ),
    ];
    let matching = options.choice("policy_under_test", &policies)?;
    let parallel = size(options.number("subtasks", 1..=MOST_PARALLEL as u64, 4)?);
    let jobs = options.number("jobs", 1..=1_000_000, 200)?;
    let seed = options.number("seed", 0..=u64::MAX, 1)?;
    let queue = options.number("queue", 1..=100_000, 1000)?;
    let depth = options.number("depth", 1..=100_000, 1000)?;
    options.finish(&WORDS)?;
    let least_cores = parallel + 2;
    if (machine.cores() as usize) < least_cores {
        return Err(UsageError::new(format!(
            "`subtasks={parallel}`: source, join and parallel subtasks need {least_cores} cores, \
             there are {}",
            machine.cores()
        ))
        .into());
    }
    let name = match matching {
        None => String::from("fass"),
        Some(MatchingPolicy::Exact) => String::from("exact"),
        Some(MatchingPolicy::Approximate { .. }) => format!("approximate-{max_interval_ms}"),
    };
    let outcome = match matching {
        None => {
            let workload = Workload {
                parallel,
                longest: fork_join::WCET,
                jobs,
                seed,
                work: ExecutionWork::Simulate(Occupation::Hold),
            };
            run_dag(machine, &workload)?
        }
        Some(matching) => {
            let experiment = Experiment {
                parallel,
                jobs: size(jobs),
                seed,
                matching,
                queue: at_least_one(queue),
                depth: at_least_one(depth),
            };
            by_stamps::run(machine, experiment)?
        }
    };
    println!(
        "{name}, N = {parallel}, {jobs} jobs, seed {seed}, {} cores",
        machine.cores()
    );
    emit_samples(&outcome.samples);
    emit_summary(&name, &outcome);
    machine.report_memory();
    outcome
        .complaint(jobs)
        .map_or(Ok(()), |text| Err(AppError::Failure(text)))
}

/// Converts a number that is within the bounds of a word.
fn size(number: u64) -> usize {
    usize::try_from(number).unwrap_or(usize::MAX)
}

fn at_least_one(number: u64) -> NonZeroUsize {
    NonZeroUsize::new(size(number)).unwrap_or(NonZeroUsize::MIN)
}

/// Runs all jobs.
fn run_dag(machine: &Machine, workload: &Workload) -> Result<ConditionOutcome, AppError> {
    let (dag, joins) = workload.build();
    // As many jobs may be in flight as fit in the subscriptions' queues by default, so no release
    // waits for the backlog on either side.
    dag.in_flight(
        u32::try_from(workload.jobs)
            .unwrap_or(u32::MAX)
            .clamp(1, 1000),
    );
    fass::finish_create_dags(&[dag])?;
    let run = machine.run()?;
    Ok(ConditionOutcome {
        samples: samples(&run, workload.parallel),
        allocations: run.allocations(),
        violations: run.violations().count() as u64 + joins.mixed(),
    })
}

/// Reads the times from the scheduler's record. Each join has the values of its own job;
/// `fork-join` checks for other values and counts them.
fn samples(run: &Run, parallel: usize) -> RunSamples {
    let dag = run.task_set().find("fork-join");
    let jobs = run.record().numbered(dag).map(|(job, _)| job);
    let instances = |subtask: usize| {
        jobs.clone().filter_map(move |job| {
            let subtask = SubtaskId(u32::try_from(subtask).ok()?);
            let instance = Instance { dag, job, subtask };
            Some((job, *run.record().instance(instance)?))
        })
    };
    let spans = |subtask| {
        instances(subtask)
            .filter_map(|(_, times)| span(&times))
            .collect()
    };
    let joins = instances(parallel + 1).filter_map(|(job, times)| {
        let joined = CompletedJoin {
            ready_ns: times.ready_ns?,
            span: span(&times)?,
        };
        Some((job, joined))
    });
    RunSamples {
        source: spans(0),
        parallel: (1..=parallel).map(spans).collect(),
        joins: joins.clone().map(|(_, joined)| joined).collect(),
        indices: joins
            .flat_map(|(job, _)| core::iter::repeat_n(job, parallel))
            .collect(),
        lost_inputs: 0,
    }
}

fn span(times: &InstanceRecord) -> Option<ExecutionSpan> {
    Some(ExecutionSpan {
        start_ns: times.start_ns?,
        finish_ns: times.finish_ns?,
    })
}

/// The most executions or joins in a line.
const BATCH: usize = 32;

/// The outcome of a condition.
pub(crate) struct ConditionOutcome {
    pub(crate) samples: RunSamples,
    /// Allocations during the run.
    pub(crate) allocations: u64,
    /// Breaches of the scheduler's rules, and joins of a DAG that mix jobs.
    pub(crate) violations: u64,
}

impl ConditionOutcome {
    /// Returns the reason that makes the condition worthless, if any.
    fn complaint(&self, jobs: u64) -> Option<String> {
        let Self {
            samples,
            allocations,
            violations,
        } = self;
        if *violations > 0 {
            return Some(format!("{violations} semantic violations"));
        }
        if samples.lost_inputs > 0 {
            return Some(format!(
                "subscriptions dropped {} messages; give them a greater `depth`",
                samples.lost_inputs
            ));
        }
        let mut all = samples.parallel.iter().chain([&samples.source]);
        if let Some(spans) = all.find(|spans| spans.len() as u64 != jobs) {
            return Some(format!("only {} of {jobs} jobs were executed", spans.len()));
        }
        (*allocations > 0).then(|| format!("{allocations} allocations while running"))
    }
}

/// Prints the times of all executions and joins.
fn emit_samples(samples: &RunSamples) {
    let subtasks = core::iter::once(&samples.source).chain(&samples.parallel);
    for (subtask, spans) in (0u64..).zip(subtasks) {
        for (batch, spans) in spans.chunks(BATCH).enumerate() {
            json::emit("executions", |line| {
                let times = spans
                    .iter()
                    .map(|span| list([span.start_ns, span.finish_ns]));
                line.number("subtask", subtask)
                    .number("first", (batch * BATCH) as u64)
                    .list("times", times);
            });
        }
    }
    for (batch, joins) in samples.joins.chunks(BATCH).enumerate() {
        json::emit("joins", |line| {
            let times = joins.iter().enumerate().map(|(offset, joined)| {
                let CompletedJoin { ready_ns, span } = joined;
                let indices = samples.indices_of(batch * BATCH + offset);
                let times = [*ready_ns, span.start_ns, span.finish_ns].into_iter();
                list(times.chain(indices.iter().copied()))
            });
            line.number("first", (batch * BATCH) as u64)
                .list("times", times);
        });
    }
}

fn list(numbers: impl IntoIterator<Item = u64>) -> String {
    let numbers: Vec<String> = numbers.into_iter().map(|it| it.to_string()).collect();
    format!("[{}]", numbers.join(","))
}

/// Prints the counts and distributions, as a machine line and for people.
fn emit_summary(name: &str, outcome: &ConditionOutcome) {
    let samples = &outcome.samples;
    let [joins, same_index, cross_index, missing] = samples.counts();
    let literal = Distribution::new(samples.join_latencies_ns());
    let cover = Distribution::new(samples.cover_delays_ns());
    json::emit("join_latency", |line| {
        line.text("policy", name)
            .number("subtasks", samples.parallel.len() as u64)
            .number("jobs", samples.source.len() as u64)
            .number("joins", joins as u64)
            .number("same_index", same_index as u64)
            .number("cross_index", cross_index as u64)
            .number("missing", missing as u64)
            .number("lost_inputs", samples.lost_inputs)
            .number("violations", outcome.violations)
            .number("allocations", outcome.allocations)
            .distribution("join_latency_ns", &literal)
            .distribution("cover_delay_ns", &cover);
    });
    println!(
        "{joins} joins: {same_index} of one job, {cross_index} across jobs; {missing} joins never \
         happened"
    );
    for (name, of) in [("join latency", literal), ("cover delay", cover)] {
        println!(
            "  {name:<14} median {:>12}  p99 {:>12}  max {:>12}",
            Ns(of.median()),
            Ns(of.p99()),
            Ns(of.max())
        );
    }
}
