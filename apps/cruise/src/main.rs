//! Boots into a car keeping its distance, and reports on the run.

#![no_std]
#![no_main]

use cruise::{ReleaseSource, build};
use fass::finish_create_dags;
use fass::shared::Wire;
use kernel::{AppError, Machine, println};

kernel::entry!(main);

fn main(machine: &Machine) -> Result<(), AppError> {
    let options = machine.options();
    let jobs = options.number("jobs", 1..=100_000, 50)?;
    let releases = [
        ("period", ReleaseSource::Period),
        ("packets", ReleaseSource::Packets),
    ];
    let releases = options.choice("releases", &releases)?;
    let wire = Wire::new("radar");
    machine.connect(&wire)?;
    machine.offer_clusters()?;
    options.finish(&["jobs", "releases", "input", "clusters"])?;

    let dags = build(&wire, releases, jobs);
    machine.spread(&dags);
    let commit = finish_create_dags(&dags)?;
    for answer in commit.answers() {
        println!("{answer}");
    }
    let run = machine.run()?;
    println!();
    for dag in run.task_set().dags() {
        let counts = run.statistics(dag.name());
        println!(
            "{}: {} jobs complete, {} deadlines missed, {} faults",
            dag.name(),
            counts.completed,
            counts.misses,
            counts.faults
        );
    }
    println!("{} allocations while jobs ran", run.allocations());
    AppError::of_violations(run.violations().count() as u64)
}
