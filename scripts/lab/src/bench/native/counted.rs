//! The instructions of one step on Linux, counted by Valgrind's tool callgrind.
//!
//! The program `rounds` of the app `hand-off` runs a graph on one worker. callgrind counts each
//! thread by itself. At the beginning of each round, callgrind writes the worker's count and begins
//! anew. So a sample is everything the worker executes in a round, from the source of a job to the
//! source of a later job. A sample includes neither the start and the end of the run, nor the
//! thread releasing jobs, nor the kernel's instructions. Valgrind hides the kernel's page of fast
//! calls: where the platform asks Linux for the time, a system call replaces the page's
//! instructions. Rounds differ only by code depending on the time.

use std::fs;
use std::path::Path;
use std::process::Command;

use super::{MeasuredGraph, jobs_a_round};
use crate::bench::baseline::Baseline;
use crate::bench::frame::Figure;
use hand_off::Shape;
use tool::progress::ProgressNote;
use tool::{image, system};

pub(super) const BASELINE: Baseline = Baseline {
    file: "tests/baselines/native.json",
    saved_by: "./scripts/bench native --save-baseline",
};

/// The number of rounds of a graph, each of some 20,000 instances.
const ROUNDS: u64 = 5;

/// Counts the instructions of each graph.
///
/// # Errors
///
/// In words: the program cannot be built, or Valgrind failed.
pub(super) fn count(graphs: &[MeasuredGraph]) -> Result<Vec<Figure>, String> {
    let program = image::build_target("hand-off", "release", ["--example", "rounds"], None)?;
    let _lasting = ProgressNote::new("counting instructions");
    let place = system::new_log("callgrind")?;
    let counted = graphs
        .iter()
        .map(|graph| of_graph(*graph, &program, &place));
    counted.collect()
}

fn of_graph(graph: MeasuredGraph, program: &Path, place: &Path) -> Result<Figure, String> {
    let (shape, size) = match graph.shape {
        Shape::Chain(size) => ("chain", size),
        Shape::ForkJoin(size) => ("fork-join", size),
        Shape::Layered { subtasks, .. } => ("layered", subtasks),
    };
    let (jobs, (step, steps)) = (jobs_a_round(graph), graph.steps);
    let numbers = [size as u64, graph.dags.into(), jobs, ROUNDS];
    let out = |part: &str| format!("{}{part}", place.display());
    let mut valgrind = Command::new("valgrind");
    valgrind
        .args(["--tool=callgrind", "--separate-threads=yes"])
        .arg("--dump-before=*::round")
        .arg(format!("--callgrind-out-file={}", out("")))
        .arg(program)
        .arg(shape)
        .args(numbers.map(|number| number.to_string()));
    system::run(&mut valgrind)?;
    // The worker is the second thread. Its first part ends where the first round begins.
    let samples = (2..=ROUNDS + 1).map(|part| total(&out(&format!(".{part}-02"))));
    let samples = samples.collect::<Result<Vec<u64>, String>>()?;
    Ok(Figure::new((1, graph.name, step), jobs * steps, samples))
}

/// Reads the number of instructions in a file of callgrind's, and removes the file.
fn total(file: &str) -> Result<u64, String> {
    let text = fs::read_to_string(file).unwrap_or_default();
    let _ = fs::remove_file(file);
    let total = text.lines().find_map(|line| line.strip_prefix("totals: "));
    let total = total.and_then(|total| total.parse().ok());
    total.ok_or_else(|| format!("callgrind has left no total in `{file}`"))
}
