//! Boots into the fork-join workload and reports what it saw.

#![no_std]
#![no_main]

extern crate alloc;

mod figures;

use alloc::vec::Vec;

use fass::{Occupation, finish_create_dags};
use fork_join::{MOST_PARALLEL, Workload};
use kernel::{Ending, Machine, println};

use figures::Figures;

kernel::entry!(main);

fn main(machine: &Machine) -> Result<(), Ending> {
    let workloads = workloads(machine)?;
    println!(
        "fork-join: source -> N parallel subtasks -> sink, period 25 ms, deadline 100 ms, {} cores;",
        machine.cores()
    );
    println!(
        "each parallel subtask executes 1 to 50 ms, {}.",
        match workloads[0].occupation {
            Occupation::Hold => "simulated: it holds its core, which halts meanwhile",
            Occupation::Spin => "computing",
        }
    );
    println!("Its mean load is 25.5 / 25: backlog and deadline misses grow with the jobs.");
    let mut all = Vec::new();
    for workload in &workloads {
        match workload.jobs {
            0 => println!("N = {}: until the console ends it ...", workload.parallel),
            jobs => println!("N = {}: {jobs} jobs ...", workload.parallel),
        }
        let (dag, joins) = workload.build();
        for answer in finish_create_dags(&[dag])?.answers() {
            println!("  {answer}");
        }
        let run = machine.run()?;
        let figures = Figures::new(workload.parallel, &run, &joins);
        figures.emit();
        all.push(figures);
    }
    println!();
    for figures in &all {
        figures.print_table();
    }
    machine.report_memory();
    all.iter()
        .find_map(Figures::complaint)
        .map_or(Ok(()), |text| Err(Ending::Failure(text)))
}

/// Reads the app's words of the command line.
fn workloads(machine: &Machine) -> Result<Vec<Workload>, Ending> {
    let options = machine.options();
    let most_parallel = MOST_PARALLEL as u64;
    let subtasks = options.numbers("subtasks", 1..=most_parallel, &[2, 4, 6])?;
    // Without end only where a person can end it.
    let least_jobs = u64::from(!machine.has_console());
    let jobs = options.number("jobs", least_jobs..=1_000_000, 200)?;
    let seed = options.number("seed", 0..=u64::MAX, 1)?;
    let occupation = options.choice(
        "occupy",
        &[("hold", Occupation::Hold), ("spin", Occupation::Spin)],
    )?;
    options.finish(&["subtasks", "jobs", "seed", "occupy"])?;
    let parallel = subtasks
        .into_iter()
        .filter_map(|parallel| usize::try_from(parallel).ok());
    Ok(parallel
        .map(|parallel| Workload {
            parallel,
            jobs,
            seed,
            occupation,
        })
        .collect())
}
