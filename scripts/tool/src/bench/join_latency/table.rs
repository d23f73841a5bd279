//! What `bench join-latency` accepts: the one table behind its parser and its help.

use crate::options::{Command, Opt, Takes};
use crate::qemu::{MOST_CORES, Mode};

/// The table of `bench join-latency`.
pub(super) static TABLE: Command = Command {
    invocation: "./scripts/bench join-latency",
    about: "Reproduces the paper's evaluation: joins by a DAG, by equal and by close stamps.",
    positional: None,
    options: &[
        Opt {
            name: "out",
            short: Some('o'),
            takes: Takes::File("DIR"),
            default: "target/join-latency",
            help: "The folder for all results; what is there already is not measured again.",
        },
        Opt {
            name: "jobs",
            short: None,
            takes: Takes::Number {
                least: 1,
                most: 100_000,
            },
            default: "2000",
            help: "Jobs of each condition.",
        },
        Opt {
            name: "subtasks",
            short: None,
            takes: Takes::Numbers { least: 1, most: 16 },
            default: "2,4,6",
            help: "Parallel subtasks N.",
        },
        Opt {
            name: "policies",
            short: None,
            takes: Takes::Text("LIST"),
            default: "fass,exact,approximate-10,approximate-30,approximate-50",
            help: "What joins: fass, exact, approximate-MS with the longest interval.",
        },
        Opt {
            name: "seed",
            short: None,
            takes: Takes::Number {
                least: 0,
                most: u64::MAX,
            },
            default: "1",
            help: "Seed of the execution times, the same for every policy.",
        },
        Opt {
            name: "repeat",
            short: None,
            takes: Takes::Number {
                least: 1,
                most: 1000,
            },
            default: "1",
            help: "Runs of each condition, with this seed and the ones after it.",
        },
        Opt {
            name: "on",
            short: None,
            takes: Takes::OneOf(&["machine", "linux"]),
            default: "machine",
            help: "Where: on the machine in QEMU, or on this computer's processors, which cores \
                   share if there are fewer; then DIR is target/join-latency-on-linux.",
        },
        Opt {
            name: "cores",
            short: None,
            takes: Takes::Number {
                least: 3,
                most: MOST_CORES,
            },
            default: "",
            help: "Processors of the guest, at least N + 2; two more than the largest N.",
        },
        Opt {
            name: "queue",
            short: None,
            takes: Takes::Number {
                least: 1,
                most: 100_000,
            },
            default: "1000",
            help: "Queue size of the synchronizers.",
        },
        Opt {
            name: "mode",
            short: None,
            takes: Takes::OneOf(Mode::NAMES),
            default: "",
            help: "What time means, see ./scripts/run --help; kvm where it works, else \
                   deterministic.",
        },
        Opt {
            name: "deterministic",
            short: None,
            takes: Takes::Nothing,
            default: "",
            help: "The same as --mode deterministic.",
        },
        Opt {
            name: "once",
            short: None,
            takes: Takes::Nothing,
            default: "",
            help: "Boot each deterministic condition once, not until two boots agree.",
        },
    ],
    notes: "\
writes into DIR:
  summary.json        counts, median, mean, p99, max of each condition
  samples.csv         each sample of each metric
  conditions/*.csv    each condition's raw times, written when it is complete
  plots/*.svg         if python3 has matplotlib

Interrupted, it keeps the conditions that are complete; run again with the same
options, it measures the others only. docs/evaluation.md explains the metrics.

exit codes: 0 all conditions are measured; 1 one failed; 2 a refused command line
",
};
