//! The command line of `soak`, and what it prints.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::process::ExitCode;

use super::{Plan, Report, run};
use crate::options::{Command, Parsed, Takes, options};
use crate::progress::Progress;
use crate::qemu::{MOST_CORES, Mode};

/// The table of `soak`.
static SOAK: Command = Command {
    invocation: "./scripts/soak",
    about: "Runs random DAG sets on the bare machine for a long time, and checks everything.",
    positional: None,
    options: options! {
        /// 16 s of guest time instead of 14 minutes; the host takes longer.
        "short": Takes::Nothing;
        /// Processors of the guest.
        "cores": Takes::number(1..=MOST_CORES), or "4";
        /// The first round.
        "first": Takes::number(0..=1_000_000), or "0";
        /// How many rounds, that is sets of DAGs; 84, with --short 16.
        "rounds": Takes::number(1..=1_000_000);
        /// Guest time in which each of the two runs of a round releases jobs; 5000, with --short 500.
        "round-ms": Takes::number(1..=10_000);
        /// Seed of all that is random.
        "seed": Takes::number(0..=u64::MAX), or "1";
        /// What time means; see ./scripts/run --help.
        "mode": Takes::OneOf(Mode::NAMES), or "deterministic";
        /// Microseconds for which an instance may wait for what it is owed; 50, and where time is
        /// real, for the host's noise, 10,000 (kvm) or 1,000,000 (threads).
        "bound-us": Takes::number(0..=1_000_000_000);
        /// Guests that run at once; as many as the host has processors, and one where time is real.
        "side-by-side": Takes::number(1..=64);
    },
    notes: "\
A round draws 3 to 8 DAGs of 3 to 12 subtasks with random graphs and execution
times, for a load of 60 to 140 percent, and runs them twice. Drawn are, too: the
policy, what becomes of jobs that overrun, clusters, faults, pauses, and whether
instances hold their cores or compute. Checked are: values; rules R1 to R5, by
the guest from its record and by the host from the trace; every job completed,
skipped or aborted, as the overrun policy allows, or lost by a fault that was
drawn; no allocation while jobs run; heap and stacks after the second run as
before it, but for what a fault keeps. Then it prints how many events there were
of each kind, and how many DAGs had which combination of policies, division of
the cores, faults, restarts and pauses. The last line is `N passed, M failed`, in
rounds; a failure is printed with the command that runs its round again.

exit codes: 0 no round failed; 1 some did; 2 a refused command line
",
};

/// Runs the subcommand with the words after its name.
#[must_use]
pub fn soak(words: &[OsString]) -> ExitCode {
    SOAK.carry_out(words, |options| {
        let plan = plan(options);
        let rounds = plan.rounds.end - plan.rounds.start;
        println!(
            "{rounds} rounds of twice {} ms on {} cores, seed {}, mode {}",
            plan.round_ms, plan.cores, plan.seed, plan.mode
        );
        let mut progress = Progress::new(rounds, "rounds");
        let report = run(&plan, |over| progress.show(over));
        progress.end();
        Ok(conclude(&report?))
    })
}

/// Makes the plan that the options ask for.
fn plan(options: &Parsed) -> Plan {
    let plan = match options.is_given("short") {
        true => Plan::SHORT,
        false => Plan::LONG,
    };
    let number = |name, usual| options.number(name).unwrap_or(usual);
    let mode = options.text("mode").and_then(Mode::from_name);
    let mode = mode.unwrap_or(plan.mode);
    // Some decisions and a switch, and where time is real, what the host does meanwhile.
    let usual_us = match mode {
        Mode::Deterministic => plan.bound_ns / 1000,
        Mode::Kvm => 10_000,
        Mode::Threads => 1_000_000,
    };
    // Where time is virtual, guests do not notice each other.
    let at_once = match mode {
        Mode::Deterministic => std::thread::available_parallelism().map_or(1, usize::from),
        Mode::Kvm | Mode::Threads => 1,
    };
    let first = number("first", 0);
    Plan {
        rounds: first..first + number("rounds", plan.rounds.end),
        round_ms: number("round-ms", plan.round_ms),
        seed: number("seed", plan.seed),
        cores: number("cores", plan.cores),
        mode,
        bound_ns: number("bound-us", usual_us) * 1000,
        side_by_side: (options.number("side-by-side"))
            .map_or(at_once, |given| usize::try_from(given).unwrap_or(at_once)),
    }
}

fn conclude(report: &Report) -> ExitCode {
    let list = |counts: &BTreeMap<String, u64>| {
        for (what, count) in counts {
            println!("{count:>10} {what}");
        }
    };
    println!("events:");
    list(&report.events);
    println!("DAGs by what happened to them:");
    list(&report.dags);
    println!(
        "no instance waited for more than {} us",
        report.longest_wait_ns.div_ceil(1000)
    );
    for line in &report.failures {
        println!("{line}");
    }
    println!("{} passed, {} failed", report.passed, report.failed);
    ExitCode::from(u8::from(report.failed > 0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failures_command_runs_the_same_round() {
        let drawn = plan(&SOAK.right("--seed 7 --cores 3 --mode threads --side-by-side 1"));
        let command = drawn.command(42);
        let again = plan(&SOAK.right(command.split_once(' ').expect("words").1));
        assert_eq!(
            again,
            Plan {
                rounds: 42..43,
                ..drawn
            }
        );
    }
}
