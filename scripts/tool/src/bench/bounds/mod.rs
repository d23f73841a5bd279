//! How many random sets of DAGs are proven, by the load that they are.
//!
//! For each number of cores and each load, from a tenth of the cores to all of them, the
//! same random sets are analysed twice: by the commit's answer, and by the forms that it
//! had before the multi-path bound (those of the oracle, with the width refinement, and the
//! utilisation tests, which both have). Nothing is measured in time, so the table is the
//! same on every host.
//!
//! - `draw`: the random sets;
//! - `sets`: what is proven of them, and of small sets with short deadlines, where the multi-path
//!   bound gains most;
//! - `stg`: bounds of published task graphs alone, also with a fixed order.

mod draw;
mod sets;
mod stg;

use std::ffi::OsString;
use std::process::ExitCode;

use sched_dag::analysis::{Overheads, Settings};
use sched_dag::{CommitOptions, ConstructionPolicy, Policy, Preemption};

use super::frame::by_plan;
use crate::options::{Command, Parsed, Takes, options};
use sets::Point;

static TABLE: Command = Command {
    invocation: "./scripts/bench bounds",
    about: "Counts the random sets of DAGs that the analysis proves, with the multi-path bound \
            and by the forms before it.",
    positional: None,
    options: options! {
        /// The numbers of cores.
        "cores": Takes::numbers(1..=64), or "4,8,16";
        /// Random sets for each number of cores and load.
        "sets": Takes::number(1..=1_000_000), or "200";
    },
    notes: "\
A set has 2 to 2 m DAGs of 5 to 20 subtasks with D = T and deadline-monotonic priorities;
its load is the sum of volume / T over the cores. A small set has 2 to 5 DAGs of 2 to 8
subtasks on 2 to 4 cores, with D from the longest path to T, and is one of 100 for each of --sets.

Exit code: 0 counted; 1 a set was proven before and is not now; 2 the command line is refused.
",
};

/// The seed of all random sets.
const SEED: u64 = 1;

/// Runs `bench bounds` with the words after its name.
pub(super) fn run(words: &[OsString]) -> ExitCode {
    let plan = |options: &Parsed| {
        options.check_distinct(&["cores"])?;
        let sets = options.number("sets").unwrap_or(200);
        Ok((options.numbers::<u32>("cores"), sets))
    };
    by_plan(&TABLE, words, plan, |(cores, sets)| measure(cores, *sets))
}

/// Counts and prints; returns whether all that was proven still is.
fn measure(cores: &[u32], count: u64) -> Result<bool, String> {
    let of_cores = |&cores: &u32| sets::by_load(cores, count, SEED);
    let points: Vec<Point> = cores.iter().flat_map(of_cores).collect();
    print!("{}", sets::table(&points));
    let small = sets::small(100 * count, SEED);
    print!("{}", sets::small_table(&small));
    print!("{}", stg::table()?);
    match sets::lost(points.iter().map(|point| &point.proven).chain([&small])) {
        0 => Ok(true),
        lost => Err(format!("{lost} sets were proven before and are not now")),
    }
}

/// Returns what any graphs are committed and analysed with.
fn terms(policy: Policy, cores: u32) -> (CommitOptions, Settings) {
    let options = CommitOptions::new(policy, cores);
    let settings = Settings {
        policy,
        preemption: Preemption::Enabled,
        cores,
        overheads: Overheads::default(),
    };
    (
        options.with_construction(ConstructionPolicy::any_graph()),
        settings,
    )
}
