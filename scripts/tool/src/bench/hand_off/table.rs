//! What `bench hand-off` accepts: the one table behind its parser and its help.

use crate::options::{Command, Opt, Takes};
use crate::qemu::MOST_CORES;

/// The table of `bench hand-off`.
pub(super) static TABLE: Command = Command {
    invocation: "./scripts/bench hand-off",
    about: "Measures on the machine the way from a completion to its successor's first instruction.",
    positional: None,
    options: &[
        Opt::new(
            "mode",
            Takes::OneOf(&["both", "deterministic", "threads", "kvm"]),
            "What is counted: instructions (deterministic), time (kvm, threads), or both.",
        )
        .or("both"),
        Opt::new(
            "compare",
            Takes::Nothing,
            "Compare the instructions with the baseline; one that grew is a failure.",
        ),
        Opt::new(
            "save-baseline",
            Takes::Nothing,
            "Write the instructions into the baseline.",
        ),
        Opt::new(
            "baseline",
            Takes::File("FILE"),
            "The baseline; tests/baselines/hand-off.json if not given.",
        ),
        Opt::new("jobs", Takes::number(2..=10_000), "Jobs of each workload.").or("200"),
        Opt::new(
            "chain",
            Takes::numbers(2..=10_000),
            "Subtasks of the chains.",
        )
        .or("64"),
        Opt::new(
            "branches",
            Takes::numbers(1..=16),
            "Parallel subtasks N of the fork-joins.",
        )
        .or("2,4,6,16"),
        Opt::new(
            "layered",
            Takes::numbers(3..=10_000),
            "Subtasks of the layered random graphs.",
        )
        .or("1000"),
        Opt::new(
            "seed",
            Takes::number(0..=u64::MAX),
            "Seed of the layered random graphs.",
        )
        .or("1"),
        Opt::new(
            "scale",
            Takes::Nothing,
            "Instead, count what the workloads cost on more cores and with more subtasks.",
        ),
        Opt::new(
            "cores",
            Takes::numbers(1..=MOST_CORES),
            "With --scale: the numbers of cores.",
        )
        .or("1,2,4,8,16,32,64"),
        Opt::new(
            "subtasks",
            Takes::numbers(3..=10_000),
            "With --scale: the numbers of subtasks of a layered random graph.",
        )
        .or("10,100,1000,10000"),
        Opt::new(
            "listing",
            Takes::File("FILE"),
            "Instead, log each instruction of one hop, count them by parts of the code, and \
             write them to FILE. Needs objdump and addr2line (binutils).",
        ),
        Opt::new(
            "append",
            Takes::Text("WORDS"),
            "More words for the guest's command line, such as trace_events=0.",
        ),
    ],
    notes: "What each row means stands in docs/performance.md.

Exit code: 0 measured, and nothing grew; 1 something grew, or did not run;
2 the command line is refused.
",
};
