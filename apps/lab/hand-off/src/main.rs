//! Boots, measures the way from a completion to its successor, and reports.
//!
//! Options: `part` selects the measurements, `jobs` is the number of jobs of each workload;
//! `chain`, `branches` and `layered` are the sizes of the workloads.

#![no_std]
#![no_main]

extern crate alloc;

mod measure;

use alloc::vec::Vec;

use kernel::options::UsageError;
use kernel::{AppError, Machine};

kernel::entry!(main);

fn main(machine: &Machine) -> Result<(), AppError> {
    let plan = MeasurementPlan::read(machine)?;
    (plan.part)(machine, &plan)?;
    machine.report_memory();
    Ok(())
}

/// A function that takes some of the measurements.
type Part = fn(&Machine, &MeasurementPlan) -> Result<(), AppError>;

const PARTS: [(&str, Part); 3] = [
    ("hand-off", on_one_core),
    ("workloads", workloads),
    ("elsewhere", elsewhere),
];

/// Takes all measurements possible on one core.
fn on_one_core(machine: &Machine, plan: &MeasurementPlan) -> Result<(), AppError> {
    measure::clock();
    workloads(machine, plan)?;
    measure::preemption(machine, plan.jobs)?;
    for &subtasks in &plan.chain {
        measure::budgets(machine, subtasks, plan.jobs)?;
    }
    wake_ups(machine, plan)
}

/// Takes the measurements that need a second core.
fn elsewhere(machine: &Machine, plan: &MeasurementPlan) -> Result<(), AppError> {
    measure::woken_cores(machine, plan.jobs)?;
    measure::joins(machine, plan.jobs)?;
    measure::hops_elsewhere(machine, plan.jobs)?;
    measure::preemption(machine, plan.jobs)?;
    wake_ups(machine, plan)
}

/// Measures chains, fork-joins and layered graphs alone.
fn workloads(machine: &Machine, plan: &MeasurementPlan) -> Result<(), AppError> {
    for &subtasks in &plan.chain {
        measure::chain(machine, subtasks, plan.jobs)?;
    }
    for &parallel in &plan.branches {
        measure::fork_join(machine, parallel, plan.jobs)?;
    }
    for &subtasks in &plan.layered {
        measure::layered(machine, subtasks, plan.jobs)?;
    }
    Ok(())
}

fn wake_ups(machine: &Machine, plan: &MeasurementPlan) -> Result<(), AppError> {
    let mut branches = plan.branches.iter();
    branches.try_for_each(|&parallel| measure::wake_ups(machine, parallel))
}

/// The measurements to take.
struct MeasurementPlan {
    part: Part,
    jobs: u64,
    chain: Vec<usize>,
    branches: Vec<usize>,
    layered: Vec<usize>,
}

impl MeasurementPlan {
    fn read(machine: &Machine) -> Result<Self, UsageError> {
        let options = machine.options();
        let sizes = |key, least, most, default: &[u64]| {
            let sizes = options.numbers(key, least..=most, default)?;
            let sizes = sizes.into_iter().map(usize::try_from);
            Ok::<Vec<usize>, UsageError>(sizes.filter_map(Result::ok).collect())
        };
        let most_parallel = sched_dag::MAX_ARITY as u64;
        let plan = Self {
            part: options.choice("part", &PARTS)?,
            jobs: options.number("jobs", 2..=100_000, 200)?,
            chain: sizes("chain", 2, 10_000, &[64])?,
            branches: sizes("branches", 1, most_parallel, &[2, 4, 6, 16])?,
            layered: sizes("layered", 3, 100_000, &[1000])?,
        };
        options.finish(&["part", "jobs", "chain", "branches", "layered"])?;
        Ok(plan)
    }
}
