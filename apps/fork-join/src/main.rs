//! Boots into the fork-join workload, and reports its figures.

#![no_std]
#![no_main]

extern crate alloc;

mod figures;

use alloc::vec::Vec;
use core::slice;
use core::time::Duration;

use fass::{Occupation, finish_create_dags};
use fork_join::{CorePace, ExecutionWork, MOST_PARALLEL, WCET, Workload};
use kernel::options::{CommandLine, UsageError};
use kernel::{AppError, Machine, println};

use figures::RunFigures;

kernel::entry!(main);

fn main(machine: &Machine) -> Result<(), AppError> {
    let workloads = workloads(machine)?;
    println!(
        "fork-join: source -> N parallel subtasks -> sink, period 25 ms, deadline 100 ms, {} cores;",
        machine.cores()
    );
    println!(
        "each parallel subtask executes 1 to {} ms, {}.",
        workloads[0].longest.as_millis(),
        match workloads[0].work {
            ExecutionWork::Simulate(Occupation::Hold) =>
                "simulated: it holds its core, which halts meanwhile",
            ExecutionWork::Simulate(Occupation::Spin) => "simulated: it watches the clock",
            ExecutionWork::Compute(_) => "computing: so long with a processor for itself",
        }
    );
    if workloads[0].longest == WCET {
        println!("Its mean load is 25.5 / 25: backlog and deadline misses grow with the jobs.");
    }
    let mut all = Vec::new();
    for workload in &workloads {
        match workload.jobs {
            0 => println!("N = {}: until the console ends it ...", workload.parallel),
            jobs => println!("N = {}: {jobs} jobs ...", workload.parallel),
        }
        let (dag, joins) = workload.build();
        for answer in finish_create_dags(slice::from_ref(&dag))?.answers() {
            println!("  {answer}");
        }
        let run = machine.run()?;
        let figures = RunFigures::new(workload.parallel, &run, &dag, &joins);
        figures.emit();
        all.push(figures);
    }
    println!();
    for figures in &all {
        figures.print_table();
    }
    machine.report_memory();
    all.iter()
        .find_map(RunFigures::complaint)
        .map_or(Ok(()), |text| Err(AppError::Failure(text)))
}

/// Reads the app's options from the command line.
fn workloads(machine: &Machine) -> Result<Vec<Workload>, AppError> {
    let options = machine.options();
    let most_parallel = MOST_PARALLEL as u64;
    let subtasks = options.numbers("subtasks", 1..=most_parallel, &[2, 4, 6])?;
    // Only a person at the console can end a run without end.
    let least_jobs = u64::from(!machine.has_console());
    let jobs = options.number("jobs", least_jobs..=1_000_000, 200)?;
    let seed = options.number("seed", 0..=u64::MAX, 1)?;
    let work = work(options)?;
    let longest_ms = options.number("longest", 1..=50, 50)?;
    options.finish(&["longest", "subtasks", "jobs", "seed", "work", "occupy"])?;
    let parallel = subtasks
        .into_iter()
        .filter_map(|parallel| usize::try_from(parallel).ok());
    Ok(parallel
        .map(|parallel| Workload {
            parallel,
            longest: Duration::from_millis(longest_ms),
            jobs,
            seed,
            work,
        })
        .collect())
}

/// Reads how the parallel subtasks spend their execution times.
fn work(options: &CommandLine<'_>) -> Result<ExecutionWork, UsageError> {
    let computes = options.choice("work", &[("simulate", false), ("compute", true)])?;
    let occupations = [("hold", Occupation::Hold), ("spin", Occupation::Spin)];
    if !computes {
        return options
            .choice("occupy", &occupations)
            .map(ExecutionWork::Simulate);
    }
    match options.text("occupy") {
        None => Ok(ExecutionWork::Compute(CorePace::measure())),
        Some(_) => Err(UsageError::new(
            "`occupy` says how execution is simulated, and `work=compute` simulates none; leave \
             one of them out",
        )),
    }
}
