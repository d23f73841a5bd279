//! What `bench hand-off` accepts: the one table behind its parser and its help.

use crate::options::{Command, Takes, options};
use crate::qemu::MOST_CORES;

/// The table of `bench hand-off`.
pub(super) static TABLE: Command = Command {
    invocation: "./scripts/bench hand-off",
    about: "Measures on the machine the way from a completion to its successor's first instruction.",
    positional: None,
    options: options! {
        /// What is counted: instructions (deterministic), time (kvm, threads), or both.
        "mode": Takes::OneOf(&["both", "deterministic", "threads", "kvm"]), or "both";
        /// Compare the instructions with the baseline; one that grew is a failure.
        "compare": Takes::Nothing;
        /// Write the instructions into the baseline.
        "save-baseline": Takes::Nothing;
        /// The baseline; tests/baselines/hand-off.json if not given.
        "baseline": Takes::File("FILE");
        /// Jobs of each workload.
        "jobs": Takes::number(2..=10_000), or "200";
        /// Subtasks of the chains.
        "chain": Takes::numbers(2..=10_000), or "64";
        /// Parallel subtasks N of the fork-joins.
        "branches": Takes::numbers(1..=16), or "2,4,6,16";
        /// Subtasks of the layered random graphs.
        "layered": Takes::numbers(3..=10_000), or "1000";
        /// Seed of the layered random graphs.
        "seed": Takes::number(0..=u64::MAX), or "1";
        /// Instead, count what the workloads cost on more cores and with more subtasks.
        "scale": Takes::Nothing;
        /// With --scale: the numbers of cores.
        "cores": Takes::numbers(1..=MOST_CORES), or "1,2,4,8,16,32,64";
        /// With --scale: the numbers of subtasks of a layered random graph.
        "subtasks": Takes::numbers(3..=10_000), or "10,100,1000,10000";
        /// Instead, log each instruction of one hop, count them by parts of the code, and write
        /// them to FILE. Needs objdump and addr2line (binutils).
        "listing": Takes::File("FILE");
        /// More words for the guest's command line, such as trace_events=0.
        "append": Takes::Text("WORDS");
    },
    notes: "What each row means stands in docs/performance.md.

Exit code: 0 measured, and nothing grew; 1 something grew, or did not run;
2 the command line is refused.
",
};
