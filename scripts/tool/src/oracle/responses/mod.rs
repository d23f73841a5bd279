//! `oracle responses`: random accepted sets on a machine whose work takes time.
//!
//! No response of a set that the analysis accepts is above its bound, where the machine's own
//! work takes what is charged for it. The sets come from `draw`; `machine` is the machine, in
//! virtual time.

mod draw;
mod machine;

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::Arc;

use common::random::Random;
use sched_dag::analysis::{Settings, answer, fix_orders};
use sched_dag::{CommitOptions, ConstructionPolicy, verify};

use crate::options::{Command, Takes as Value, options};
use crate::progress::Progress;
use draw::sample;
use machine::{Takes, longest_responses_ns};

static TABLE: Command = Command {
    invocation: "./scripts/oracle responses",
    about: "Runs random sets that the analysis accepts, in virtual time with the overheads that \
            it charges, and holds every response against its bound.",
    positional: None,
    options: options! {
        /// Accepted sets to run.
        "sets": Value::number(1..=100_000_000), or "1000";
        /// Seed of the first set; each has the next one.
        "seed": Value::number(0..=u64::MAX), or "1";
    },
    notes: "\
A set has up to 4 DAGs of up to 8 subtasks on up to 5 cores. Each runs twice for 12 of its longest
periods: with WCETs and all that is charged, and with drawn parts of both: late interrupts, decisions,
switches, resumptions.

Exit code: 0 no response was above its bound; 1 one was, which is printed with its seed; 2 the
command line is refused.
",
};

/// What was seen of all sets.
#[derive(Default)]
struct Seen {
    accepted: u64,
    drawn: u64,
    responses: u64,
    above: u64,
    /// Bounds by the test that gave them.
    by_test: BTreeMap<String, u64>,
    /// The largest response as a part of its bound, in thousandths.
    tightest_permille: u64,
}

/// Runs `oracle responses` with the words after its name.
pub(super) fn command(words: &[OsString]) -> ExitCode {
    TABLE.carry_out(words, |options| {
        let sets = options.number("sets").unwrap_or(1_000);
        let mut seeds = options.number("seed").unwrap_or(1)..;
        let mut progress = Progress::new(sets, "accepted sets");
        let mut seen = Seen::default();
        while seen.accepted < sets
            && let Some(seed) = seeds.next()
        {
            for line in seen.add(seed) {
                println!("{line}");
            }
            progress.show(seen.accepted);
        }
        progress.end();
        print!("{}", seen.text());
        Ok(ExitCode::from(u8::from(seen.above > 0)))
    })
}

impl Seen {
    /// Draws a set, runs it if it is accepted, and returns a line for each response above its
    /// bound.
    fn add(&mut self, seed: u64) -> Vec<String> {
        let mut random = Random::new(seed);
        let (specs, options, costs) = sample(&mut random);
        self.drawn += 1;
        let commit = CommitOptions::new(options.policy, options.cores)
            .with_construction(ConstructionPolicy::any_graph());
        let Ok(verified) = verify(&specs, &commit) else {
            // A WCET or a path beyond the deadline.
            return Vec::new();
        };
        let mut task_set = verified.task_set;
        let settings = Settings {
            policy: options.policy,
            preemption: options.preemption,
            cores: options.cores,
            overheads: costs.overheads(),
        };
        fix_orders(&mut task_set, &settings);
        let answer = answer(&task_set, &settings);
        if !answer.is_proven() {
            return Vec::new();
        }
        self.accepted += 1;
        let task_set = Arc::new(task_set);
        let bounds: Vec<_> = answer.bounds.into_iter().flatten().collect();
        for bound in &bounds {
            *self.by_test.entry(bound.test.to_string()).or_default() += 1;
        }
        let longest = task_set.dags().iter().map(|dag| dag.period_ns()).max();
        let until_ns = 12 * longest.unwrap_or(0);
        let mut lines = Vec::new();
        for takes in [Takes::Most, Takes::Drawn] {
            let seen_ns =
                longest_responses_ns(&task_set, options, costs, takes, until_ns, &mut random);
            for (dag, (bound, seen_ns)) in bounds.iter().zip(seen_ns).enumerate() {
                self.responses += 1;
                let permille = seen_ns * 1_000 / bound.bound_ns.max(1);
                self.tightest_permille = self.tightest_permille.max(permille);
                if seen_ns > bound.bound_ns {
                    self.above += 1;
                    lines.push(format!(
                        "seed {seed}, dag {dag}: a response of {seen_ns} ns, beyond {bound:?}; \
                         {options:?}, {costs:?}, {takes:?}"
                    ));
                }
            }
        }
        lines
    }

    fn text(&self) -> String {
        let tests = self.by_test.iter();
        let tests: String = tests
            .map(|(test, count)| format!("  {count:>10} by {test}\n"))
            .collect();
        format!(
            "{} sets drawn, {} accepted; bounds:\n{tests}{} longest responses, the tightest {} of \
             1000 parts of its bound; {} above their bounds\n",
            self.drawn, self.accepted, self.responses, self.tightest_permille, self.above
        )
    }
}

#[cfg(test)]
mod tests {
    use super::Seen;

    #[test]
    fn no_response_of_an_accepted_set_is_above_its_bound_with_overheads_charged() {
        let mut seen = Seen::default();
        for seed in 1..=2_400 {
            let lines = seen.add(seed);
            assert!(lines.is_empty(), "{lines:?}");
        }
        let said = seen.text();
        assert!(seen.accepted > 200 && seen.by_test.len() >= 5, "{said}");
        // Bounds that no response comes near would hold for any machine.
        assert!(seen.tightest_permille > 950, "{said}");
    }
}
