//! Boots into a flight, and reports on the flight.

#![no_std]
#![no_main]

use core::time::Duration;

use drone::{Flight, Workload};
use fass::finish_create_dags;
use kernel::report::Ns;
use kernel::{AppError, Machine, Run, json, println};
use sched_dag::Vertex;

kernel::entry!(main);

fn main(machine: &Machine) -> Result<(), AppError> {
    let options = machine.options();
    let seconds = options.number("seconds", 1..=100_000, 8)?;
    let seed = options.number("seed", 0..=u64::MAX, 1)?;
    let delay_us = options.number("delay_us", 0..=1_000_000, 0)?;
    let fault_at = options.number("fault_at", 0..=1_000_000, 0)?;
    let survived = options.number("survived", 0..=1000, 0)?;
    let workload = Workload {
        seconds,
        seed,
        takes_wcet: false,
        delay: Duration::from_micros(delay_us),
        fault_at: (fault_at > 0).then_some(fault_at),
        survived: u32::try_from(survived).unwrap_or(u32::MAX),
    };
    if fault_at > 0 {
        machine.accept_faults();
    }
    if delay_us > 0 {
        machine.accept_exceeded_bounds();
    }

    let system = workload.build();
    machine.offer(&[&system.reserve])?;
    options.finish(&["seconds", "seed", "delay_us", "fault_at", "survived"])?;
    let commit = finish_create_dags(&system.dags)?;
    for answer in commit.answers() {
        println!("{answer}");
    }
    for staleness in commit.staleness() {
        println!("{staleness}");
    }
    let run = machine.run()?;
    report(&run, &system.flight)
}

fn report(run: &Run, flight: &Flight) -> Result<(), AppError> {
    println!();
    println!("{flight}");
    let mut misses = 0;
    let mut vertices = (0..).map(Vertex);
    for dag in run.task_set().dags() {
        let counts = run.statistics(dag.name());
        misses += counts.misses;
        println!(
            "  {:<10}{:>7} jobs, {} deadlines missed, {} skipped",
            dag.name(),
            counts.completed,
            counts.misses,
            counts.skips
        );
        for (subtask, vertex) in dag.subtasks().iter().zip(&mut vertices) {
            let times = run.times();
            let observed = times.map(|times| times.subtask(vertex).execution_time.distribution());
            println!(
                "    {:<12} WCET {:>10}, observed {:>12}",
                subtask.name(),
                Ns(subtask.wcet_ns().unwrap_or(0)),
                Ns(observed.unwrap_or_default().max())
            );
        }
    }
    let violations = run
        .violations()
        .inspect(|found| println!("violation: {found}"))
        .count() as u64;
    println!(
        "{violations} violations, {} allocations while it flew",
        run.allocations()
    );
    json::emit("drone", |line| {
        line.number("waypoints", flight.waypoints())
            .number("landed", u64::from(flight.has_landed()))
            .number("deadline_misses", misses)
            .number("attitude_misses", run.statistics("attitude").misses)
            .number("frames_skipped", run.statistics("camera").skips)
            .number("descents", run.statistics("descent").completed)
            .number("violations", violations)
            .number("allocations", run.allocations());
    });
    AppError::of_violations(violations)
}
