//! What is to be measured, and on what: settled before anything is built.

use std::path::{Path, PathBuf};

use super::condition::{Condition, Policy};
use crate::files;
use crate::options::{Command, Parsed, Takes, options};
use crate::qemu::Mode;

/// The table of `bench join-latency`.
pub(super) static TABLE: Command = Command {
    invocation: "./scripts/bench join-latency",
    about: "Reproduces the paper's evaluation: joins by a DAG, by equal and by close stamps.",
    positional: None,
    options: options! {
        /// The folder for all results; what is there already is not measured again. If not given,
        /// target/join-latency, or target/join-latency-on-linux.
        "out" 'o': Takes::File("DIR");
        /// Jobs of each condition.
        "jobs": Takes::number(1..=100_000), or "2000";
        /// Parallel subtasks N; a condition has two processors more than the largest.
        "subtasks": Takes::numbers(1..=16), or "2,4,6";
        /// What joins: fass, exact, approximate-MS with the longest interval.
        "policies": Takes::Text("LIST"), or "fass,exact,approximate-10,approximate-30,approximate-50";
        /// Runs of each condition, with the seeds from 1 on of the execution times, the same for
        /// every policy.
        "repeat": Takes::number(1..=1000), or "1";
        /// Where: on the machine in QEMU, or on this computer's processors, which cores share if
        /// there are fewer.
        "on": Takes::OneOf(&["machine", "linux"]), or "machine";
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

/// Everything that all conditions have in common, and the conditions.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    pub(super) out: PathBuf,
    /// For each N all policies, for each of them all seeds.
    pub(super) conditions: Vec<Condition>,
    pub(super) seeds: Vec<u64>,
    pub(super) jobs: u64,
    pub(super) queue: u64,
    pub(super) cores: u64,
    pub(super) memory_mib: u64,
    /// Whether the conditions are programs of this computer.
    pub(super) on_linux: bool,
    /// The mode that was named; which one it is, the built image settles.
    pub(super) named: Option<Mode>,
    /// Whether a deterministic condition is booted once only.
    pub(super) once: bool,
}

impl Plan {
    /// Settles the plan.
    ///
    /// # Errors
    ///
    /// What the options ask for cannot be: one line that says why.
    pub(super) fn new(options: &Parsed) -> Result<Plan, String> {
        let on_linux = options.text("on") == Some("linux");
        let of_guests = options.given_of(&["mode", "deterministic", "once"]);
        if let Some(name) = of_guests.filter(|_| on_linux) {
            return Err(format!(
                "`--{name}` is for guests; leave it or `--on linux` out"
            ));
        }
        (options.named(&["out"]).iter()).try_for_each(files::check_folder)?;
        options.check_distinct(&["policies", "subtasks"])?;
        let policies = Policy::list(options.text("policies").unwrap_or_default())?;
        let mut named = options.text("mode").and_then(Mode::from_name);
        if options.is_given("deterministic") {
            let other = named.filter(|mode| *mode != Mode::Deterministic);
            if let Some(mode) = other {
                return Err(format!(
                    "`--mode {mode}` and `--deterministic` exclude each other; give one"
                ));
            }
            named = Some(Mode::Deterministic);
        }
        let once = options.is_given("once");
        if let Some(mode) = named.filter(|mode| once && *mode != Mode::Deterministic) {
            return Err(format!(
                "`--once` is for deterministic conditions, and the mode is {mode}, in which each \
                 is booted once; leave it out"
            ));
        }
        let number = |name| options.number(name).unwrap_or(1);
        let subtasks: Vec<usize> = options.numbers("subtasks");
        let seeds: Vec<u64> = (1..=number("repeat")).collect();
        let of_size = |&subtasks: &usize| {
            let seeds = &seeds;
            let of_policy = move |&policy: &Policy| {
                seeds.iter().map(move |&seed| Condition {
                    policy,
                    subtasks,
                    seed,
                })
            };
            policies.iter().flat_map(of_policy)
        };
        let conditions = subtasks.iter().flat_map(of_size).collect();
        // Source, join and parallel subtasks: none waits for a core.
        let cores = subtasks.iter().max().map_or(1, |most| *most as u64) + 2;
        let folder = match on_linux {
            true => "target/join-latency-on-linux",
            false => "target/join-latency",
        };
        let jobs = number("jobs");
        Ok(Plan {
            out: options.path("out").unwrap_or(Path::new(folder)).into(),
            conditions,
            seeds,
            jobs,
            queue: number("queue"),
            cores,
            // The kernel records each instance, and the app its joins: half a KiB.
            memory_mib: 64 + (jobs * cores).div_ceil(2048),
            on_linux,
            named,
            once,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{Path, Plan, TABLE};

    fn plan(line: &str) -> Result<Plan, String> {
        Plan::new(&TABLE.right(line))
    }

    #[test]
    fn every_combination_is_a_condition() {
        let plan = plan("--deterministic --repeat 2 --policies fass,exact").unwrap();
        assert_eq!(plan.conditions.len(), 3 * 2 * 2);
        assert_eq!((plan.cores, plan.seeds), (8, vec![1, 2]));
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let refusal = |line: &str| plan(line).unwrap_err();
        assert!(refusal("--subtasks 2,2 --deterministic").contains("twice"));
        assert!(refusal("--policies exact,exact").contains("twice"));
        assert!(refusal("--mode threads --deterministic").contains("exclude"));
        assert!(refusal("--on linux --once").contains("`--once` is for guests"));
    }

    #[test]
    fn on_linux_results_have_a_folder_of_their_own() {
        let out = |line: &str| plan(line).unwrap().out;
        assert_eq!(out(""), Path::new("target/join-latency"));
        let on_linux = "target/join-latency-on-linux";
        assert_eq!(out("--on linux"), Path::new(on_linux));
        assert_eq!(out("--on linux --out x"), Path::new("x"));
    }
}
