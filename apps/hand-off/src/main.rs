//! Boots, measures the way from a completion to its successor, and reports.
//!
//! Words of the command line: `jobs` of each workload; `chain`, `branches` and
//! `layered` are the sizes of the workloads, `seed` is that of the layered ones.

#![no_std]
#![no_main]

extern crate alloc;

mod measure;
mod row;

use alloc::vec::Vec;

use hand_off::Shape;
use kernel::options::UsageError;
use kernel::{Ending, Machine};

kernel::entry!(main);

fn main(machine: &Machine) -> Result<(), Ending> {
    let plan = Plan::read(machine)?;
    measure::clock();
    for &subtasks in &plan.chain {
        measure::chain(machine, subtasks, &plan)?;
    }
    for &parallel in &plan.branches {
        measure::fork_join(machine, parallel, &plan)?;
    }
    for &subtasks in &plan.layered {
        let seed = plan.seed;
        measure::layered(machine, Shape::Layered { subtasks, seed }, &plan)?;
    }
    machine.report_memory();
    Ok(())
}

/// What is to be measured.
struct Plan {
    jobs: u64,
    chain: Vec<usize>,
    branches: Vec<usize>,
    layered: Vec<usize>,
    seed: u64,
}

impl Plan {
    fn read(machine: &Machine) -> Result<Self, UsageError> {
        let options = machine.options();
        let sizes = |key, least, most, default: &[u64]| {
            let sizes = options.numbers(key, least..=most, default)?;
            let sizes = sizes.into_iter().map(usize::try_from);
            Ok::<Vec<usize>, UsageError>(sizes.filter_map(Result::ok).collect())
        };
        let most_parallel = sched_dag::MAX_ARITY as u64;
        let plan = Self {
            jobs: options.number("jobs", 2..=100_000, 200)?,
            chain: sizes("chain", 2, 10_000, &[64])?,
            branches: sizes("branches", 1, most_parallel, &[2, 4, 6, 16])?,
            layered: sizes("layered", 3, 100_000, &[1000])?,
            seed: options.number("seed", 0..=u64::MAX, 1)?,
        };
        options.finish(&["jobs", "chain", "branches", "layered", "seed"])?;
        Ok(plan)
    }
}
