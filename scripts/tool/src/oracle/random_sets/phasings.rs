//! `oracle phasings`: how far the accepted sets are from those that nothing refutes.
//!
//! Small sets are simulated in all phasings: each DAG but the first takes each whole offset below
//! its period, the first none, and each subtask takes its WCET. A set is *refuted* if a job
//! misses its deadline within four hyperperiods. A set that is not refuted may
//! still miss with shorter execution times, or with sporadic releases. So what is accepted is compared
//! with an upper bound of what could be.

use std::ffi::OsString;
use std::fmt::Write;
use std::process::ExitCode;
use std::sync::Arc;

use sched_dag::analysis::{Settings, answer};
use sched_dag::{
    CommitOptions, ConstructionPolicy, DagSpec, Policy, Preemption, Priority, SchedulerOptions,
    verify,
};

use super::draw::{dag, edges};
use super::machine::{Costs, Takes, longest_responses_ns};
use crate::options::{Command, Opt, Takes as Value};
use crate::progress::Progress;
use crate::random::Random;

/// The periods that are drawn; all divide the hyperperiod.
const PERIODS: [u64; 4] = [6, 8, 12, 24];

const HYPERPERIOD: u64 = 24;

static TABLE: Command = Command {
    invocation: "./scripts/oracle phasings",
    about: "Counts small random sets that the analysis accepts, next to those that no simulation \
            in any phasing refutes.",
    positional: None,
    options: &[
        Opt::new(
            "sets",
            Value::number(1..=1_000_000),
            "Sets for each row of the table.",
        )
        .or("100"),
        Opt::new("seed", Value::number(0..=u64::MAX), "Seed of the sets.").or("1"),
    ],
    notes: "\
A set has 2 or 3 DAGs of 1 to 4 subtasks of 1 to 4 ns, periods of 6, 8, 12 or 24 ns, D = T, static
priorities by period; all loads.

Exit code: 0 counted; 1 an accepted set was refuted; 2 the command line is refused.
",
};

/// One kind of sets.
struct Row {
    options: SchedulerOptions,
    sets: u64,
    accepted: u64,
    not_refuted: u64,
    /// Accepted and refuted, which must not be.
    wrong: u64,
}

/// Runs `oracle phasings` with the words after its name.
pub(crate) fn command(words: &[OsString]) -> ExitCode {
    let options = match TABLE.read(words) {
        Ok(options) => options,
        Err(code) => return code,
    };
    let sets = options.number("sets").unwrap_or(100);
    let seed = options.number("seed").unwrap_or(1);
    let mut progress = Progress::new(8 * sets, "sets");
    let rows = rows(sets, seed, |over| progress.show(over));
    progress.end();
    print!("{}", table(&rows));
    ExitCode::from(u8::from(rows.iter().any(|row| row.wrong > 0)))
}

fn rows(sets: u64, seed: u64, mut show: impl FnMut(u64)) -> Vec<Row> {
    let mut rows = Vec::new();
    for policy in [Policy::StaticPriority, Policy::Edf] {
        for preemption in [Preemption::Enabled, Preemption::Disabled] {
            for cores in [2, 3] {
                let mut row = Row {
                    options: SchedulerOptions {
                        policy,
                        preemption,
                        cores,
                    },
                    sets: 0,
                    accepted: 0,
                    not_refuted: 0,
                    wrong: 0,
                };
                let mut random = Random::new(seed);
                while row.sets < sets {
                    row.add(&mut random);
                    show(rows.len() as u64 * sets + row.sets);
                }
                rows.push(row);
            }
        }
    }
    rows
}

impl Row {
    /// Draws a set, and counts it unless its commit is refused.
    fn add(&mut self, random: &mut Random) {
        let specs = set(random);
        let commit = CommitOptions::new(self.options.policy, self.options.cores)
            .with_construction(ConstructionPolicy::any_graph());
        let Ok(verified) = verify(&specs, &commit) else {
            return;
        };
        let settings = Settings {
            policy: self.options.policy,
            preemption: self.options.preemption,
            cores: self.options.cores,
            overheads: Costs::default().overheads(),
        };
        let is_accepted = answer(&verified.task_set, &settings).is_proven();
        let is_refuted = is_refuted(specs, &commit, self.options, random);
        self.sets += 1;
        self.accepted += u64::from(is_accepted);
        self.not_refuted += u64::from(!is_refuted);
        self.wrong += u64::from(is_accepted && is_refuted);
    }
}

fn set(random: &mut Random) -> Vec<DagSpec> {
    let mut periods: Vec<u64> = (0..random.within(2, 3))
        .map(|_| PERIODS[usize::try_from(random.within(0, 3)).unwrap_or(0)])
        .collect();
    periods.sort_unstable();
    let dags = (0..).zip(periods).map(|(priority, period)| {
        let wcets_ns: Vec<u64> = (0..random.within(1, 4))
            .map(|_| random.within(1, 4))
            .collect();
        let edges = edges(random, wcets_ns.len());
        let mut spec = dag(period, period, &wcets_ns, edges);
        for subtask in &mut spec.subtasks {
            subtask.priority = Some(Priority(priority));
        }
        spec
    });
    dags.collect()
}

/// Simulates all phasings until a job is late.
fn is_refuted(
    mut specs: Vec<DagSpec>,
    commit: &CommitOptions,
    options: SchedulerOptions,
    random: &mut Random,
) -> bool {
    let periods: Vec<u64> = specs.iter().filter_map(|spec| spec.period_ns).collect();
    let phasings: u64 = periods[1..].iter().product();
    (0..phasings).any(|mut phasing| {
        for (spec, period) in specs[1..].iter_mut().zip(&periods[1..]) {
            spec.offset_ns = phasing % period;
            phasing /= period;
        }
        let Ok(verified) = verify(&specs, commit) else {
            return true;
        };
        let task_set = Arc::new(verified.task_set);
        let until_ns = 4 * HYPERPERIOD;
        let costs = Costs::default();
        let seen_ns =
            longest_responses_ns(&task_set, options, costs, Takes::Most, until_ns, random);
        seen_ns
            .iter()
            .zip(&periods)
            .any(|(seen, period)| seen > period)
    })
}

fn table(rows: &[Row]) -> String {
    let mut text = format!(
        "{:<10}{:<12}{:>6}{:>8}{:>12}{:>14}{:>10}\n",
        "policy", "preemption", "cores", "sets", "accepted", "not refuted", "ratio"
    );
    for row in rows {
        let policy = match row.options.policy {
            Policy::StaticPriority => "static",
            Policy::Edf => "edf",
        };
        let preemption = match row.options.preemption {
            Preemption::Enabled => "on",
            Preemption::Disabled => "off",
        };
        let ratio = 100.0 * row.accepted as f64 / row.not_refuted.max(1) as f64;
        // Writing into a `String` cannot fail.
        let _ = writeln!(
            text,
            "{policy:<10}{preemption:<12}{:>6}{:>8}{:>12}{:>14}{ratio:>8.1} %",
            row.options.cores, row.sets, row.accepted, row.not_refuted
        );
    }
    let wrong: u64 = rows.iter().map(|row| row.wrong).sum();
    let _ = writeln!(text, "{wrong} accepted sets refuted");
    text
}

#[cfg(test)]
mod tests {
    use super::{rows, table};

    #[test]
    fn what_is_accepted_is_not_refuted() {
        let rows = rows(6, 1, |_| {});
        let said = table(&rows);
        assert!(rows.iter().all(|row| row.wrong == 0), "{said}");
        let sum = |count: fn(&super::Row) -> u64| rows.iter().map(count).sum::<u64>();
        let (accepted, not_refuted) = (sum(|row| row.accepted), sum(|row| row.not_refuted));
        assert!(accepted > 0 && accepted <= not_refuted, "{said}");
        assert!(not_refuted < sum(|row| row.sets), "{said}");
    }
}
