//! How many random sets of DAGs are proven, by the load that they are.
//!
//! For each number of cores and each load, from a tenth of the cores to all of them, the
//! same random sets are analysed twice: by the commit's answer, and by the forms that it
//! had before the multi-path bound (those of the oracle, with the width refinement, and the
//! utilisation tests, which both have). Nothing is measured in time, so the table is the
//! same on every host.
//!
//! - `draw`: the random sets;
//! - `curves`: what is proven of them;
//! - `small`: small sets with short deadlines, where the multi-path bound gains most;
//! - `stg`: bounds of published task graphs alone, also with a fixed order.

mod curves;
mod draw;
mod small;
mod stg;

use std::ffi::OsString;
use std::fs;
use std::process::ExitCode;

use super::frame;
use crate::files;
use crate::options::{Command, Parsed, Refusal, Takes, options};
use curves::{Point, measure};

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
        /// Seed of the sets.
        "seed": Takes::number(0..=u64::MAX), or "1";
        /// Write the table as DIR/bounds.csv, too, and draw DIR/plots/bounds.svg.
        "out": Takes::File("DIR");
    },
    notes: "\
A set has 2 to 2 m DAGs of 5 to 20 subtasks with D = T and deadline-monotonic priorities;
its load is the sum of volume / T over the cores. A small set has 2 to 5 DAGs of 2 to 8
subtasks on 2 to 4 cores, with D from the longest path to T, and is one of 100 for each of --sets.

Exit code: 0 counted; 1 a set was proven before and is not now, or nothing can be written;
2 the command line is refused.
",
};

/// Runs `bench bounds` with the words after its name.
pub(super) fn run(words: &[OsString]) -> ExitCode {
    TABLE.carry_out(words, |options| {
        options.check_distinct(&["cores"]).map_err(Refusal::Usage)?;
        measure_all(options).map(|()| ExitCode::SUCCESS)
    })
}

fn measure_all(options: &Parsed) -> Result<(), Refusal> {
    let cores = options.numbers("cores").into_iter();
    let sets = options.number("sets").unwrap_or(200);
    let seed = options.number("seed").unwrap_or(1);
    let points: Vec<Point> = cores.flat_map(|cores| measure(cores, sets, seed)).collect();
    print!("{}", curves::table(&points));
    let counts = small::measure(100 * sets, seed);
    print!("{}", small::table(&counts));
    print!("{}", stg::table(&stg::measure()?));
    if let Some(out) = options.path("out") {
        let file = out.join("bounds.csv");
        let written = fs::create_dir_all(out).and_then(|()| fs::write(&file, curves::csv(&points)));
        written.map_err(|error| format!("`--out {}`: {error}", files::place(out)))?;
        match frame::draw("bounds.py", out) {
            Ok(()) => println!("{}", out.join("plots/bounds.svg").display()),
            Err(line) => println!("{line}"),
        }
    }
    let lost = points.iter().map(|point| point.lost);
    match lost
        .chain(counts.iter().map(|count| count.lost))
        .sum::<u64>()
    {
        0 => Ok(()),
        lost => Err(format!("{lost} sets were proven before and are not now").into()),
    }
}
