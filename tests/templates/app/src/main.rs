//! Boots the app and says how its jobs went.

#![no_std]
#![no_main]

extern crate alloc;

use alloc::format;

use fass::finish_create_dags;
use kernel::report::{Distribution, Ns};
use kernel::{Ending, Machine, println};
use sched_dag::DagId;

kernel::entry!(main);

/// The only DAG of the commit.
const DAG: DagId = DagId(0);

fn main(machine: &Machine) -> Result<(), Ending> {
    let options = machine.options();
    let jobs = options.number("jobs", 1..=100_000, 100)?;
    options.finish(&["jobs"])?;

    let commit = finish_create_dags(&[app_template::build(jobs)])?;
    for answer in commit.answers() {
        println!("{answer}");
    }
    let run = machine.run()?;

    let record = run.record();
    let response_times = (0..)
        .zip(record.jobs(DAG))
        .filter_map(|(job, times)| Some(record.completion_ns(DAG, job)? - times.release_ns?));
    let response_times = Distribution::new(response_times);
    let statistics = run.statistics(DAG);
    println!(
        "{} jobs complete, {} deadlines missed",
        statistics.completed, statistics.misses
    );
    println!(
        "response time: median {}, at most {}",
        Ns(response_times.median()),
        Ns(response_times.max())
    );
    println!("{} allocations while jobs ran", run.allocations());
    match run.violations().count() {
        0 => Ok(()),
        count => Err(Ending::Failure(format!(
            "{count} violations of the model's rules"
        ))),
    }
}
