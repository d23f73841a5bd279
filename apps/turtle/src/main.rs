//! Boots into a robot driven by ROS 2, and reports on the run.

#![no_std]
#![no_main]

use fass::finish_create_dags;
use kernel::{AppError, Machine, println};
use turtle::build;

kernel::entry!(main);

fn main(machine: &Machine) -> Result<(), AppError> {
    let options = machine.options();
    let jobs = options.number("jobs", 0..=1_000_000_000, 0)?;
    let mut node = machine.ros_node("turtle")?;
    let dags = build(&mut node, jobs);
    machine.join(node)?;
    machine.offer_clusters()?;
    options.finish(&["jobs", "clusters"])?;

    machine.spread(&dags);
    let commit = finish_create_dags(&dags)?;
    for answer in commit.answers() {
        println!("{answer}");
    }
    let run = machine.run()?;
    let counts = run.statistics("drive");
    println!(
        "turtle: {} jobs complete, {} deadlines missed; {} allocations while jobs ran",
        counts.completed,
        counts.misses,
        run.allocations()
    );
    AppError::of_violations(run.violations().count() as u64)
}
