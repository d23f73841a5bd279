//! Boots into the left or the right machine, and reports on the run.

#![no_std]
#![no_main]

use core::time::Duration;

use fass::finish_create_dags;
use kernel::{AppError, Machine, println};
use pair::{Role, build};

kernel::entry!(main);

fn main(machine: &Machine) -> Result<(), AppError> {
    let options = machine.options();
    let roles = [("left", Role::Left), ("right", Role::Right)];
    let role = options.choice("role", &roles)?;
    let jobs = options.number("jobs", 1..=1_000_000, 300)?;
    let us = |name, usual| {
        options
            .number(name, 1..=1_000_000, usual)
            .map(Duration::from_micros)
    };
    let (delay, period) = (us("delay_us", 5_000)?, us("period_us", 10_000)?);
    let name = if role == Role::Left { "left" } else { "right" };
    let mut node = machine.ros_node(name)?;
    let (dags, _) = build(&mut node, role, delay, (jobs, period));
    machine.join(node)?;
    options.finish(&["role", "jobs", "delay_us", "period_us", "router"])?;

    let commit = finish_create_dags(&dags)?;
    for answer in commit.answers() {
        println!("{answer}");
    }
    let run = machine.run()?;
    println!("{} allocations while jobs ran", run.allocations());
    AppError::of_violations(run.violations().count() as u64)
}
