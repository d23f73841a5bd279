//! Boots into an echo, and reports on the run.

#![no_std]
#![no_main]

use core::time::Duration;

use echo::{build, wire};
use fass::finish_create_dags;
use kernel::{AppError, Machine, println};

kernel::entry!(main);

fn main(machine: &Machine) -> Result<(), AppError> {
    let options = machine.options();
    // Time ends the run, not a number of jobs: packets arriving together share a job.
    let milliseconds = options.number("ms", 0..=86_400_000, 0)?;
    let distance = Duration::from_micros(options.number("us", 50..=1_000_000, 1_000)?);
    let wire = wire();
    machine.connect(&wire)?;
    machine.offer_clusters()?;
    options.finish(&["ms", "us", "input", "clusters"])?;

    let dags = build(&wire, distance, milliseconds);
    machine.spread(&dags);
    let commit = finish_create_dags(&dags)?;
    for answer in commit.answers() {
        println!("{answer}");
    }
    let run = machine.run()?;
    let counts = run.statistics("echo");
    println!(
        "echo: {} jobs complete, {} deadlines missed; {} allocations while jobs ran",
        counts.completed,
        counts.misses,
        run.allocations()
    );
    AppError::of_violations(run.violations().count() as u64)
}
