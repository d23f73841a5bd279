//! The command line of `soak`, and what it prints.

use std::ffi::OsString;
use std::process::ExitCode;
use std::time::Duration;

use replay::shown::shown;

use super::figures::Figures;
use super::plan::{Length, Part, Plan, usual_bound_ns};
use super::{Report, run};
use crate::options::{Command, Parsed, Refusal, Takes, options};
use crate::progress::Progress;
use crate::qemu::{MOST_CORES, Mode};

/// The most that a load may be, in percent.
const MOST_LOAD: u64 = 1000;

/// The table of `soak`.
static SOAK: Command = Command {
    invocation: "./scripts/soak",
    about: "Runs random DAG sets on the bare machine for a long time, and checks everything.",
    positional: None,
    options: options! {
        /// 16 s of guest time instead of 14 minutes, of the same kinds; the host takes longer.
        "short": Takes::Nothing;
        /// Processors of the guest.
        "cores": Takes::number(1..=MOST_CORES), or "4";
        /// The load, in percent of all cores.
        "load": Takes::number(1..=MOST_LOAD), or "90";
        /// The load of the overload, in percent of all cores.
        "overload": Takes::number(1..=MOST_LOAD), or "130";
        /// Guest time at the load, half of it under each policy.
        "seconds": Takes::number(1..=86_400), or "600";
        /// Guest time in overload with each overrun policy, likewise.
        "overload-seconds": Takes::number(0..=86_400), or "60";
        /// Guest time in which a round, that is one set of DAGs, releases jobs.
        "round-ms": Takes::number(1..=10_000), or "5000";
        /// Seed of the sets and the execution times.
        "seed": Takes::number(0..=u64::MAX), or "1";
        /// What time means; see ./scripts/run --help.
        "mode": Takes::OneOf(Mode::NAMES), or "deterministic";
        /// Only this part, by the table's name, such as edf-130-skip.
        "only": Takes::Text("PART");
        /// The first round of each part.
        "first": Takes::number(0..=1_000_000), or "0";
        /// The rounds of each part, instead of a time.
        "rounds": Takes::number(1..=1_000_000);
        /// Microseconds for which an instance may wait for what it is owed; 50, and where time is
        /// real, for the host's noise, 10,000 (kvm) or 1,000,000 (threads).
        "bound-us": Takes::number(0..=1_000_000_000);
        /// Guests that run at once; as many as the host has processors, and one where time is real.
        "side-by-side": Takes::number(1..=64);
    },
    notes: "\
A round draws a random set of 3 to 8 DAGs of 3 to 12 subtasks, whose execution
times are random too, and runs it for the time of a round. Where instances hold
their cores, some rounds have faults, pauses and clusters. Checked are: rules R1
to R5, by the guest from its record and by the host from the trace; every job
completed, skipped or aborted, as the overrun policy allows, or lost by a fault
that was drawn; no allocation while jobs run; heap and stacks as before, but for
what a fault keeps. Then it prints how many DAGs had which
combination of policy, overrun policy, division of the cores, fault, restart and
pause; one that no DAG had is `never`. The last line is `N passed, M failed`, in
rounds; a failure is printed with the command that runs its round again.

exit codes: 0 no round failed; 1 some did; 2 a refused command line
",
};

/// Runs the subcommand with the words after its name.
#[must_use]
pub fn soak(words: &[OsString]) -> ExitCode {
    SOAK.carry_out(words, |options| {
        let plan = plan(options).map_err(Refusal::Usage)?;
        println!(
            "{} rounds of {} ms on {} cores, seed {}, mode {}",
            plan.rounds(),
            plan.round.as_millis(),
            plan.cores,
            plan.seed,
            plan.mode
        );
        let mut progress = Progress::new(plan.rounds(), "rounds");
        let report = run(&plan, |over| progress.show(over));
        progress.end();
        Ok(conclude(&report?))
    })
}

/// Makes the plan that the options ask for.
fn plan(options: &Parsed) -> Result<Plan, String> {
    let lengths = ["seconds", "overload-seconds"];
    for whole in ["short", "rounds"] {
        if let Some(part) = lengths.iter().find(|name| options.is_given(name))
            && options.is_given(whole)
        {
            return Err(format!(
                "`--{whole}` and `--{part}` both say how long it takes; give one"
            ));
        }
    }
    let number = |name| options.number(name).unwrap_or(0);
    let mut length = match options.is_given("short") {
        true => Length::SHORT,
        false => Length::LONG,
    };
    let places = [&mut length.seconds, &mut length.overload_seconds];
    for (name, place) in lengths.into_iter().zip(places) {
        if options.is_given(name) {
            *place = number(name);
        }
    }
    if options.is_given("round-ms") {
        length.round = Duration::from_millis(number("round-ms"));
    }
    let mode = options.text("mode").and_then(Mode::from_name);
    let mode = mode.unwrap_or(Mode::Deterministic);
    let mut plan = Plan {
        cores: number("cores"),
        seed: number("seed"),
        first: number("first"),
        mode,
        bound_ns: (options.number("bound-us"))
            .map_or_else(|| usual_bound_ns(mode), |bound_us| bound_us * 1000),
        side_by_side: side_by_side(options, mode),
        ..Plan::new(length, number("load"), number("overload"))
    };
    if options.is_given("rounds") {
        plan.parts
            .iter_mut()
            .for_each(|part| part.rounds = number("rounds"));
    }
    if let Some(only) = options.text("only") {
        let names: Vec<String> = plan.parts.iter().map(Part::to_string).collect();
        plan.parts.retain(|part| part.to_string() == only);
        plan.parts.truncate(1);
        if plan.parts.is_empty() {
            let (only, names) = (shown(only), names.join(", "));
            return Err(format!("`--only {only}`: there are {names}"));
        }
    }
    Ok(plan)
}

/// Where time is virtual, guests do not notice each other.
fn side_by_side(options: &Parsed, mode: Mode) -> usize {
    let given = options.number("side-by-side");
    let usual = match mode {
        Mode::Deterministic => std::thread::available_parallelism().map_or(1, usize::from),
        Mode::Kvm | Mode::Threads => 1,
    };
    given.map_or(usual, |given| usize::try_from(given).unwrap_or(usual))
}

fn conclude(report: &Report) -> ExitCode {
    println!("{}", Figures::head());
    for (name, figures) in &report.parts {
        println!("{}", figures.row(name));
    }
    println!("{}", report.total.row("all"));
    println!(
        "DAGs by what happened to them:\n{}",
        report.coverage.table()
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

    fn plan_of(line: &str) -> Result<Plan, String> {
        plan(&SOAK.right(line))
    }

    #[test]
    fn a_failures_command_runs_the_same_round_and_an_unknown_part_is_refused() {
        let plan = plan_of("--seed 7 --overload 150").expect("a plan");
        let part = plan.parts.last().expect("parts");
        let command = plan.command(part, 42);
        let again = plan_of(command.split_once(' ').expect("words").1).expect("a plan");
        let boots: Vec<_> = again.boots().collect();
        let [boot] = &boots[..] else {
            panic!("{boots:?}");
        };
        assert_eq!((boot.first, boot.rounds), (42, 1));
        assert_eq!(boot.part.to_string(), part.to_string());
        let of = |plan: &Plan| (plan.seed, plan.round, plan.cores, plan.mode, plan.bound_ns);
        assert_eq!(of(&again), of(&plan));
        let refused = plan_of("--only edf-90-skip").expect_err("there is none");
        assert!(refused.starts_with("`--only edf-90-skip`: there are static-90-queue, edf-90"));
    }
}
