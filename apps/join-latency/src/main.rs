//! Boots into one condition of the evaluation and prints the times of all jobs.

#![no_std]
#![no_main]

extern crate alloc;

mod by_dag;
mod by_stamps;
mod output;

use alloc::format;
use alloc::string::String;
use core::num::NonZeroUsize;
use core::time::Duration;

use fass::Occupation;
use fork_join::{MOST_PARALLEL, PERIOD, Work, Workload};
use join_latency::{Experiment, Matching};
use kernel::options::UsageError;
use kernel::{Ending, Machine, println};

kernel::entry!(main);

/// The words of the command line that are the app's.
const WORDS: [&str; 7] = [
    "policy_under_test",
    "max_interval_ms",
    "subtasks",
    "jobs",
    "seed",
    "queue",
    "depth",
];

fn main(machine: &Machine) -> Result<(), Ending> {
    let options = machine.options();
    let max_interval_ms = options.number("max_interval_ms", 1..=1_000_000, 50)?;
    let max_interval_ns = max_interval_ms * 1_000_000;
    let policies = [
        ("fass", None),
        ("exact", Some(Matching::Exact)),
        (
            "approximate",
            Some(Matching::Approximate { max_interval_ns }),
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
        Some(Matching::Exact) => String::from("exact"),
        Some(Matching::Approximate { .. }) => format!("approximate-{max_interval_ms}"),
    };
    let outcome = match matching {
        None => {
            let workload = Workload {
                parallel,
                longest: fork_join::WCET,
                jobs,
                seed,
                work: Work::Simulate(Occupation::Hold),
            };
            by_dag::run(machine, &workload)?
        }
        Some(matching) => {
            let experiment = Experiment {
                parallel,
                jobs: size(jobs),
                seed,
                matching,
                queue: at_least_one(queue),
                depth: at_least_one(depth),
                period_ns: u64::try_from(PERIOD.as_nanos()).unwrap_or(u64::MAX),
                execute: hold,
            };
            by_stamps::run(machine, experiment)?
        }
    };
    println!(
        "{name}, N = {parallel}, {jobs} jobs, seed {seed}, {} cores",
        machine.cores()
    );
    output::emit_samples(&outcome.samples);
    output::emit_summary(&name, &outcome);
    machine.report_memory();
    outcome
        .complaint(jobs)
        .map_or(Ok(()), |text| Err(Ending::Failure(text)))
}

/// Executes by holding the core while the processor halts.
fn hold(time: Duration) {
    fass::execute_for(time, Occupation::Hold);
}

/// Converts a number that is within the bounds of a word.
fn size(number: u64) -> usize {
    usize::try_from(number).unwrap_or(usize::MAX)
}

fn at_least_one(number: u64) -> NonZeroUsize {
    NonZeroUsize::new(size(number)).unwrap_or(NonZeroUsize::MIN)
}
