//! What `bench hand-off` accepts: the one table behind its parser and its help.

use crate::options::{Command, Opt, Takes};
use crate::qemu::MOST_CORES;

/// The table of `bench hand-off`.
pub(super) static TABLE: Command = Command {
    invocation: "./scripts/bench hand-off",
    about: "Measures on the machine the way from a completion to its successor's first instruction.",
    positional: None,
    options: &[
        Opt {
            name: "mode",
            short: None,
            takes: Takes::OneOf(&["both", "deterministic", "threads", "kvm"]),
            default: "both",
            help: "What is counted: instructions (deterministic), time (kvm, threads), or both.",
        },
        Opt {
            name: "compare",
            short: None,
            takes: Takes::Nothing,
            default: "",
            help: "Compare the instructions with the baseline; one that grew is a failure.",
        },
        Opt {
            name: "save-baseline",
            short: None,
            takes: Takes::Nothing,
            default: "",
            help: "Write the instructions into the baseline.",
        },
        Opt {
            name: "baseline",
            short: None,
            takes: Takes::Text("FILE"),
            default: "",
            help: "The baseline; tests/baselines/hand-off.json if not given.",
        },
        Opt {
            name: "jobs",
            short: None,
            takes: Takes::Number {
                least: 2,
                most: 10_000,
            },
            default: "200",
            help: "Jobs of each workload.",
        },
        Opt {
            name: "chain",
            short: None,
            takes: Takes::Numbers {
                least: 2,
                most: 10_000,
            },
            default: "64",
            help: "Subtasks of the chains.",
        },
        Opt {
            name: "branches",
            short: None,
            takes: Takes::Numbers { least: 1, most: 16 },
            default: "2,4,6,16",
            help: "Parallel subtasks N of the fork-joins.",
        },
        Opt {
            name: "layered",
            short: None,
            takes: Takes::Numbers {
                least: 3,
                most: 10_000,
            },
            default: "1000",
            help: "Subtasks of the layered random graphs.",
        },
        Opt {
            name: "seed",
            short: None,
            takes: Takes::Number {
                least: 0,
                most: u64::MAX,
            },
            default: "1",
            help: "Seed of the layered random graphs.",
        },
        Opt {
            name: "scale",
            short: None,
            takes: Takes::Nothing,
            default: "",
            help: "Instead, count what the workloads cost on more cores and with more subtasks.",
        },
        Opt {
            name: "cores",
            short: None,
            takes: Takes::Numbers {
                least: 1,
                most: MOST_CORES,
            },
            default: "1,2,4,8,16,32,64",
            help: "With --scale: the numbers of cores.",
        },
        Opt {
            name: "subtasks",
            short: None,
            takes: Takes::Numbers {
                least: 3,
                most: 10_000,
            },
            default: "10,100,1000,10000",
            help: "With --scale: the numbers of subtasks of a layered random graph.",
        },
        Opt {
            name: "append",
            short: None,
            takes: Takes::Text("WORDS"),
            default: "",
            help: "More words for the guest's command line, such as trace_events=0.",
        },
    ],
    notes: "What each row means stands in docs/performance.md.

Exit code: 0 measured, and nothing grew; 1 something grew, or did not run;
2 the command line is refused.
",
};
