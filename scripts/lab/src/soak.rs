//! The subcommand `soak`: random DAG sets for a long time, everything checked.
//!
//! A *round* is a random scenario (`tests/scenarios/src/random.rs`). The guest of the boot tests
//! draws a round, runs the scenario twice, and after each run checks everything within its reach:
//! rules, accounts, allocations, memory, stacks. Here each round is a boot, several at a time, and
//! each run's trace is judged by the same rules, from other evidence.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::ops::Range;
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use sched_dag::DagId;
use sched_dag::journal::EventKind;

use tool::options::{Command, CommandLine, ValueKind, options};
use tool::outcome::{self, Outcome};
use tool::progress::{Progress, SILENCE};
use tool::qemu::{MOST_CORES, Mode, Qemu};
use tool::trace::read;
use tool::{image, install, probe, system};
use views::findings::check;
use views::protocol::MachineLine;
use views::record::{COUNTED_TOLERANCE_NS, Run};

/// The options and the help text of `soak`.
static SOAK: Command = Command {
    invocation: "./scripts/soak",
    about: "Runs random DAG sets on the bare machine for a long time, and checks everything.",
    positional: None,
    options: OPTIONS,
    notes: "\
A round draws 3 to 8 DAGs of 3 to 12 subtasks with random graphs and execution
times, for a load of 60 to 140 percent, and runs them twice. Drawn are, too: the
policy, what becomes of jobs that overrun, clusters, tables, deadlines of sinks,
waits, signals, faults, pauses, modes, and whether instances hold their cores or
compute. Checked are: values; rules R1 to R5, by the guest from its record and by
the host from the trace; every job completed, skipped or aborted, as the overrun
policy allows, or lost by a fault that was drawn; no allocation while jobs run;
heap and stacks after the second run as before it, but for what a fault keeps.
Then it prints how many events there were of each kind, and how many DAGs had
which combination of policies, division of the cores, faults, restarts and
pauses. The last line is `N passed, M failed`, in rounds; a failure is printed
with the command that runs its round again.
With --jobs, random sets with all features of DAGs together are first run in
virtual time, each run varied towards a response beyond its bound; then it
prints how many of those jobs each pair of features had.
With --frames, and nothing else, so many frames of a network with wrong bytes are
heard on the host, and a tenth of them on the machine, with as large a flood of
right ones, next to a control loop that may miss nothing.
With --messages, and nothing else, a client of a router hears so many messages
with wrong bytes, and so many of each type of ROS 2 are decoded and written again.

exit codes: 0 no round failed; 1 some did; 2 a refused command line
",
};

options! {
    /// 16 s of guest time instead of 14 minutes; the host takes longer.
    SHORT: ValueKind::Nothing;
    /// Processors of the guest.
    CORES: ValueKind::Number(1, MOST_CORES), or "4";
    /// Jobs of random sets to simulate on the host first, which takes minutes for 10^8.
    JOBS: ValueKind::Number(1, 1_000_000_000_000);
    /// Frames with wrong bytes to hear, instead of rounds.
    FRAMES: ValueKind::Number(1, 1_000_000_000_000);
    /// Messages with wrong bytes to hear, instead of rounds.
    MESSAGES: ValueKind::Number(1, 1_000_000_000_000);
    /// The first round.
    FIRST: ValueKind::Number(0, 1_000_000), or "0";
    /// How many rounds, that is sets of DAGs; 84, with --short 16.
    ROUNDS: ValueKind::Number(1, 1_000_000);
    /// Guest time in which each of the two runs of a round releases jobs; 5000, with --short 500.
    ROUND_MS: ValueKind::Number(1, 10_000);
    /// Seed of all that is random.
    SEED: ValueKind::Number(0, u64::MAX), or "1";
    /// The meaning of time; see ./scripts/run --help.
    MODE: ValueKind::OneOf(Mode::NAMES), or "deterministic";
    /// Microseconds for which an instance may wait for what it is owed; 50, and where time is
    /// real, for the host's noise, 10,000 (kvm) or 1,000,000 (threads).
    BOUND_US: ValueKind::Number(0, 1_000_000_000);
    /// Guests that run at once; as many as the host has processors, and one where time is real.
    SIDE_BY_SIDE: ValueKind::Number(1, 64);
}

/// Runs the subcommand with the words after its name.
pub fn soak(words: &[OsString]) -> ExitCode {
    SOAK.carry_out(words, |options| {
        let seed = options.number(name::SEED).unwrap_or(1);
        if let Some(frames) = options.number(name::FRAMES) {
            let on_host = (["net", "it", "no_mutated_frame"], frames);
            let on_machine = (
                ["harness", "boots", "no_storm_of_frames"],
                frames.div_ceil(10),
            );
            return Ok(hear("FRAMES", [on_host, on_machine], seed)?);
        }
        if let Some(messages) = options.number(name::MESSAGES) {
            let tests = [
                ["zenoh", "it", "no_mutated"],
                ["ros", "it", "all_types_have"],
            ];
            return Ok(hear("MESSAGES", tests.map(|test| (test, messages)), seed)?);
        }
        let are_kept = options.number(name::JOBS).map_or(Ok(true), simulate)?;
        let plan = plan(options);
        let rounds = plan.rounds.end - plan.rounds.start;
        println!(
            "{rounds} rounds of twice {} ms on {} cores, seed {}, mode {}",
            plan.round_ms, plan.cores, plan.seed, plan.mode
        );
        let mut progress = Progress::new(rounds, "rounds");
        let report = run(&plan, |over| progress.show(over));
        progress.wipe();
        Ok(match (conclude(&report?), are_kept) {
            (_, false) => ExitCode::FAILURE,
            (conclusion, true) => conclusion,
        })
    })
}

/// Runs the property test that compares bounds with virtual time, for `jobs` jobs, with full
/// optimization. Reports whether the property holds.
fn simulate(jobs: u64) -> Result<bool, String> {
    let test = ["sched-dag", "it", "bounds_hold_whatever"];
    hold(test, &[("ANALYSIS_JOBS", jobs)])
}

/// Runs tests that hear frames or messages with wrong bytes. Each test finds the number in the
/// environment variable named by `what`.
fn hear(what: &str, tests: [([&str; 3], u64); 2], seed: u64) -> Result<ExitCode, String> {
    let mut are_heard = true;
    for (test, count) in tests {
        are_heard &= hold(test, &[(what, count), ("SEED", seed)])?;
    }
    Ok(ExitCode::from(u8::from(!are_heard)))
}

/// Runs a test of a package, given by its target and name, with the given numbers in its
/// environment, and reports whether the test passes. The package is fully optimized.
fn hold([package, target, test]: [&str; 3], numbers: &[(&str, u64)]) -> Result<bool, String> {
    let mut cargo = system::cargo();
    for package in [package, "random"] {
        cargo.arg(format!(
            "--config=profile.dev.package.{package}.opt-level=3"
        ));
    }
    cargo.args(["test", "--quiet", "--package", package, "--test", target]);
    cargo.args([test, "--", "--nocapture"]);
    cargo.envs(
        numbers
            .iter()
            .map(|(name, number)| (name, number.to_string())),
    );
    let status = cargo.status();
    Ok(status
        .map_err(|error| format!("cannot start cargo: {error}"))?
        .success())
}

/// Makes the plan from the options.
fn plan(options: &CommandLine) -> SoakPlan {
    let plan = match options.is_given(name::SHORT) {
        true => SoakPlan::SHORT,
        false => SoakPlan::LONG,
    };
    let number = |name, usual| options.number(name).unwrap_or(usual);
    let mode = options.text(name::MODE).and_then(Mode::from_name);
    let mode = mode.unwrap_or(plan.mode);
    // The deterministic bound covers some decisions and a switch; where time is real the host's
    // noise comes on top.
    let usual_us = match mode {
        Mode::Deterministic => plan.bound_ns / 1000,
        Mode::Kvm => 10_000,
        Mode::Threads => 1_000_000,
    };
    // In virtual time guests do not disturb each other, so they may share the host.
    let at_once = match mode {
        Mode::Deterministic => std::thread::available_parallelism().map_or(1, usize::from),
        Mode::Kvm | Mode::Threads => 1,
    };
    let first = number(name::FIRST, 0);
    SoakPlan {
        rounds: first..first + number(name::ROUNDS, plan.rounds.end),
        round_ms: number(name::ROUND_MS, plan.round_ms),
        seed: number(name::SEED, plan.seed),
        cores: number(name::CORES, plan.cores),
        mode,
        bound_ns: number(name::BOUND_US, usual_us) * 1000,
        side_by_side: (options.number(name::SIDE_BY_SIDE))
            .map_or(at_once, |given| usize::try_from(given).unwrap_or(at_once)),
    }
}

fn conclude(report: &SoakReport) -> ExitCode {
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

/// The guest drawing the rounds, by its package.
const GUEST: &str = "guest-tests";

/// The guest's memory, in MiB; up to a quarter is for journals.
const MEMORY_MIB: u64 = 256;

/// The number of runs of a round.
const RUNS_A_ROUND: u64 = 2;

/// The largest number of breaches shown for a run.
const SHOWN: usize = 5;

/// The rounds to run, and their settings.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SoakPlan {
    /// The numbers of the rounds.
    pub rounds: Range<u64>,
    /// The guest time in which each run releases jobs, in milliseconds.
    pub round_ms: u64,
    /// The seed of all random draws.
    pub seed: u64,
    /// The cores of each guest.
    pub cores: u64,
    /// The meaning of time.
    pub mode: Mode,
    /// The longest time an instance may wait for a core owed by the rules.
    pub bound_ns: u64,
    /// The number of guests running at the same time.
    pub side_by_side: usize,
}

/// The result of a soak run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SoakReport {
    /// The number of events of each kind.
    pub events: BTreeMap<String, u64>,
    /// The number of DAGs with each combination of policy, overrun policy, division of the cores,
    /// fault, restart and pause.
    pub dags: BTreeMap<String, u64>,
    /// The longest time an instance waited although due to run.
    pub longest_wait_ns: u64,
    /// A line for each failure, with the command to repeat its round.
    pub failures: Vec<String>,
    /// The rounds without a failure.
    pub passed: u64,
    /// The rounds with a failure.
    pub failed: u64,
}

impl SoakPlan {
    /// The rounds of the long form: a quarter of an hour.
    pub const LONG: SoakPlan = SoakPlan {
        rounds: 0..84,
        round_ms: 5000,
        seed: 1,
        cores: 4,
        mode: Mode::Deterministic,
        bound_ns: COUNTED_TOLERANCE_NS,
        side_by_side: 1,
    };

    /// The rounds of the short form: some seconds, for a test.
    pub const SHORT: SoakPlan = SoakPlan {
        rounds: 0..16,
        round_ms: 500,
        ..Self::LONG
    };

    /// Returns the command to run one round again.
    fn command(&self, round: u64) -> String {
        let SoakPlan {
            round_ms,
            seed,
            cores,
            mode,
            bound_ns,
            ..
        } = self;
        format!(
            "./scripts/soak --first {round} --rounds 1 --round-ms {round_ms} --seed {seed} \
             --cores {cores} --mode {mode} --bound-us {}",
            bound_ns / 1000
        )
    }
}

/// Runs a plan to its end, and calls `show` with the number of finished rounds: after each boot,
/// and at least every [`SILENCE`].
///
/// # Errors
///
/// In words: there is no QEMU or no image, or a guest could not be started.
pub fn run(plan: &SoakPlan, mut show: impl FnMut(u64)) -> Result<SoakReport, String> {
    install::ensure_qemu()?;
    let image = image::build(GUEST)?;
    let qemu = Qemu {
        mode: plan.mode,
        cores: plan.cores,
        memory_mib: MEMORY_MIB,
        ..Qemu::default()
    };
    probe::choose(Some(plan.mode), plan.mode, &qemu, &image)?;
    let next = AtomicU64::new(plan.rounds.start);
    let mut report = SoakReport::default();
    let (send, receive) = mpsc::channel();
    thread::scope(|scope| {
        for _ in 0..plan.side_by_side.max(1) {
            let (send, next, qemu, path) = (send.clone(), &next, &qemu, &image);
            scope.spawn(move || {
                loop {
                    // Each worker takes the next round, so no worker waits for a slow one.
                    let round = next.fetch_add(1, Ordering::Relaxed);
                    if round >= plan.rounds.end {
                        return;
                    }
                    let booted = boot(plan, qemu, path, round);
                    // The receiver is gone if the guest of another round did not start.
                    if send.send((round, booted)).is_err() {
                        return;
                    }
                }
            });
        }
        // The last sender: the loop below ends when all workers have dropped theirs.
        drop(send);
        loop {
            match receive.recv_timeout(SILENCE) {
                Ok((round, booted)) => report.add_round(plan, round, &booted?),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(report),
            }
            show(report.passed + report.failed);
        }
    })
}

fn boot(plan: &SoakPlan, qemu: &Qemu, image: &Path, round: u64) -> Result<Outcome, String> {
    // In real time the host's noise would exceed budgets, and rounds would fail.
    let budget_factor = match plan.mode {
        Mode::Deterministic => 10,
        Mode::Kvm | Mode::Threads => 0,
    };
    let qemu = Qemu {
        guest_words: format!(
            "mode={} test=soak first={round} round_ms={} seed={} events=on \
             budget_factor={budget_factor}",
            plan.mode, plan.round_ms, plan.seed
        ),
        ..qemu.clone()
    };
    // The guest's own time, and far more for its traces, which pass a serial line.
    let guest_time = Duration::from_millis(plan.round_ms.saturating_mul(RUNS_A_ROUND));
    let limit = Duration::from_secs(60) + guest_time.saturating_mul(30);
    outcome::boot(&qemu, image, &system::new_log("soak")?, limit, |_| {})
}

impl SoakReport {
    /// Judges a round, and removes its log if nothing is wrong.
    fn add_round(&mut self, plan: &SoakPlan, round: u64, outcome: &Outcome) {
        let mut wrong = Vec::from_iter(outcome.judge().err().map(|fault| fault.reason));
        let lines: Vec<_> = outcome.transcript.of_kind("scenario").collect();
        match read(&outcome.serial) {
            // Two runs, each with its line and its trace; fewer mean that the guest died.
            Ok(runs) if [lines.len() as u64, runs.len() as u64] == [RUNS_A_ROUND; 2] => {
                for (line, run) in lines.into_iter().zip(&runs) {
                    wrong.extend(self.judge(round, line, run, plan.bound_ns));
                }
            }
            Ok(_) => wrong.push("did not run to its end".into()),
            Err(fault) => wrong.push(format!("its trace: {fault}")),
        }
        if wrong.is_empty() {
            self.passed += 1;
            let _ = fs::remove_file(&outcome.log);
            return;
        }
        // The log stays: it is the evidence.
        self.failed += 1;
        wrong.push(format!("the serial log is {}", outcome.log.display()));
        wrong.push(format!("again by: {}", plan.command(round)));
        let wrong = wrong.into_iter().map(|why| format!("round {round}: {why}"));
        self.failures.extend(wrong);
    }

    /// Judges a run by the guest's own line and by its trace; returns the failures.
    fn judge(&mut self, round: u64, line: &MachineLine, run: &Run, bound_ns: u64) -> Vec<String> {
        let title = line.text_at("title").unwrap_or_default();
        let mut wrong = Vec::new();
        match line.text_at("wrong") {
            Some("") if title.starts_with(&format!("round {round}: ")) => {}
            _ => wrong.push(line.text.clone()),
        }
        // Without its first events a trace proves too little.
        if run.lost > 0 || !run.complete {
            let lost = run.lost;
            wrong.push(format!(
                "its trace has no end, or has lost its first {lost} events"
            ));
        }
        let findings = check(run, bound_ns);
        let breaches = findings.breaches.iter();
        let shown = breaches.map(|breach| breach.with_names(&run.task_set).to_string());
        wrong.extend(shown.take(SHOWN));
        if let Some(more) = findings.breaches.len().checked_sub(SHOWN + 1) {
            wrong.push(format!("and {} breaches more", more + 1));
        }
        self.longest_wait_ns = (self.longest_wait_ns).max(findings.figures.longest_inversion_ns);
        for event in &run.events {
            *self.events.entry(event.what.to_string()).or_default() += 1;
        }
        for dag in (0..).map(DagId).take(run.task_set.dags().len()) {
            *self.dags.entry(fate(run, dag)).or_default() += 1;
        }
        wrong
    }
}

/// Describes the settings under which a DAG ran, and the incidents of its run.
fn fate(run: &Run, dag: DagId) -> String {
    let (policy, overrun) = (run.options.policy, run.task_set.dag(dag).overrun());
    let cores = match run.task_set.is_divided() {
        true => "Clusters",
        false => "Together",
    };
    let kinds = [EventKind::Ended, EventKind::Restarted, EventKind::Off].into_iter();
    let had = |what: &EventKind| (run.events.iter()).any(|it| it.dag == dag && it.what == *what);
    let happened: String = (kinds.filter(had)).map(|what| format!(" {what}")).collect();
    format!("{policy:?} {overrun:?} {cores}{happened}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::right;

    #[test]
    fn a_failures_command_runs_the_same_round() {
        let drawn = plan(&right(
            &SOAK,
            "--seed 7 --cores 3 --mode threads --side-by-side 1",
        ));
        let command = drawn.command(42);
        let again = plan(&right(&SOAK, command.split_once(' ').expect("words").1));
        assert_eq!(
            again,
            SoakPlan {
                rounds: 42..43,
                ..drawn
            }
        );
    }
}
