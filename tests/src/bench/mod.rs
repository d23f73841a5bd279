//! Measurements on the host, for people and for machines.
//!
//! `bench WHAT` measures one part of the project on this host, in this build,
//! and prints a table and one JSON object a figure. Absolute times depend on
//! the host; the figures that have a limit are ratios of times taken in the
//! same run. The exit code is 0 if all limits hold, 1 if one does not, and 2 for
//! a refused command line.
//!
//! - [`scheduler`]: the commit, and the cost of a dispatched instance;
//! - [`hand_off`]: the way from a completion to its successor, on the machine;
//! - [`join_latency`]: the paper's evaluation, on the machine in QEMU;
//! - [`makespan`]: task graphs on the machine, beside their published optima;
//! - [`native`]: the scheduler on this host's own processors.

pub mod hand_off;
pub mod join_latency;
pub mod makespan;
pub mod native;
pub mod scheduler;

use std::process::ExitCode;
use std::time::{Duration, Instant};

const USAGE: &str = "usage: bench WHAT [options]

WHAT is one of:
  scheduler      the commit of a large DAG, and the cost of a dispatched instance:
                 prints a table and a JSON object for each figure
  hand-off       the way from a completion to its successor's first instruction, in
                 instructions and in time; see bench hand-off --help
  join-latency   the paper's evaluation: boots each condition, writes samples,
                 figures, plots and a report; see bench join-latency --help
  makespan       task graphs with published optimal makespans, on the machine; see
                 bench makespan --help
  native         the scheduler on this host's own processors, in nanoseconds a hop, a job,
                 an instance; see bench native --help

Exit code: 0 all limits hold, 1 one does not, 2 the command line is refused.
";

/// Runs the subcommand.
#[must_use]
pub fn bench(words: &[String]) -> ExitCode {
    match words.split_first().map(|(what, rest)| (&**what, rest)) {
        Some(("hand-off", rest)) => return hand_off::run(rest),
        Some(("join-latency", rest)) => return join_latency::run(rest),
        Some(("makespan", rest)) => return makespan::run(rest),
        Some(("native", rest)) => return native::run(rest),
        _ => {}
    }
    if words.iter().any(|word| word == "--help" || word == "-h") {
        print!("{USAGE}");
        return ExitCode::SUCCESS;
    }
    match words {
        [] => refuse("measure what?"),
        [what] if what == "scheduler" => scheduler::run(),
        [what] => refuse(&format!("nothing to measure is called `{what}`")),
        [_, unexpected, ..] => refuse(&format!("`{unexpected}` is one word too many")),
    }
}

fn refuse(reason: &str) -> ExitCode {
    eprint!("bench: {reason}\n{USAGE}");
    ExitCode::from(2)
}

/// Returns how long `work` takes.
fn time<T>(work: impl FnOnce() -> T) -> Duration {
    let start = Instant::now();
    std::hint::black_box(work());
    start.elapsed()
}

/// Returns the median, which a few interrupted rounds do not move.
fn median(mut durations: Vec<Duration>) -> Duration {
    durations.sort_unstable();
    durations[durations.len() / 2]
}

/// Returns how many times `one` is as long as `other`.
fn ratio(one: Duration, other: Duration) -> f64 {
    one.as_secs_f64() / other.as_secs_f64()
}
