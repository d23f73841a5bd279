//! What `bench join-latency` accepts: the one table behind its parser and its help.

use crate::options::{Command, Takes, options};
use crate::qemu::{MOST_CORES, Mode};

/// The table of `bench join-latency`.
pub(super) static TABLE: Command = Command {
    invocation: "./scripts/bench join-latency",
    about: "Reproduces the paper's evaluation: joins by a DAG, by equal and by close stamps.",
    positional: None,
    options: options! {
        /// The folder for all results; what is there already is not measured again.
        "out" 'o': Takes::File("DIR"), or "target/join-latency";
        /// Jobs of each condition.
        "jobs": Takes::number(1..=100_000), or "2000";
        /// Parallel subtasks N.
        "subtasks": Takes::numbers(1..=16), or "2,4,6";
        /// What joins: fass, exact, approximate-MS with the longest interval.
        "policies": Takes::Text("LIST"), or "fass,exact,approximate-10,approximate-30,approximate-50";
        /// Seed of the execution times, the same for every policy.
        "seed": Takes::number(0..=u64::MAX), or "1";
        /// Runs of each condition, with this seed and the ones after it.
        "repeat": Takes::number(1..=1000), or "1";
        /// Where: on the machine in QEMU, or on this computer's processors, which cores share if
        /// there are fewer; then DIR is target/join-latency-on-linux.
        "on": Takes::OneOf(&["machine", "linux"]), or "machine";
        /// Processors of the guest, at least N + 2; two more than the largest N.
        "cores": Takes::number(3..=MOST_CORES);
        /// Queue size of the synchronizers.
        "queue": Takes::number(1..=100_000), or "1000";
        /// What time means, see ./scripts/run --help; kvm where it works, else deterministic.
        "mode": Takes::OneOf(Mode::NAMES);
        /// The same as --mode deterministic.
        "deterministic": Takes::Nothing;
        /// Boot each deterministic condition once, not until two boots agree.
        "once": Takes::Nothing;
    },
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
