//! `oracle schedules --in-kernel`: its command line and what it prints.

use std::ffi::OsString;
use std::process::ExitCode;

use replay::Case;
use replay::lines::Malformed;

use super::{Judged, Settings, run};
use crate::options::{Command, Parsed, Refusal, Takes, options};
use crate::oracle::read;
use crate::oracle::schedules::{self, Deviation};
use crate::qemu::{MOST_CORES, Machine, Mode};

static IN_KERNEL: Command = Command {
    invocation: "./scripts/oracle schedules --in-kernel",
    about: "Runs reference schedules on the bare machine in QEMU and compares.",
    positional: Some((
        Takes::File("FILE..."),
        "Reference schedules, as in tests/oracle.",
    )),
    options: options! {
        /// On the machine, not in virtual time on the host.
        "in-kernel": Takes::Nothing;
        /// Leave out the cases for more cores.
        "cores-up-to": Takes::number(1..=MOST_CORES), or "64";
        /// The length of a unit of time in microseconds.
        "unit-us": Takes::number(100..=10_000_000), or "10000";
        /// Events less than this apart count as one instant; a 100th of a unit, with --work compute
        /// a 40th.
        "window-us": Takes::number(0..=2_500_000);
        /// How much before a unit's end execution in it ends; a 500th of a unit, with --work
        /// compute a 40th.
        "guard-us": Takes::number(0..=2_500_000);
        /// How far starts and finishes may be from the reference, in percent of a unit; 2, with
        /// --work compute 5.
        "tolerance": Takes::number(1..=49);
        /// Whether execution is simulated, or cores also compute, for half of each unit in all.
        "work": Takes::OneOf(&["simulate", "compute"]), or "simulate";
        /// What time means; see ./scripts/run --help.
        "mode": Takes::OneOf(Mode::NAMES), or "deterministic";
        /// The board that QEMU imitates.
        "machine": Takes::OneOf(Machine::NAMES), or "microvm";
    },
    notes: "\
Each case runs with its number of cores, its policy, and preemption as it says.
Compared are start, finish and preemptions of every instance, and release, finish
and miss of every job. Printed are the first difference of each failing case, a
line for each number of cores, and `N passed, M failed`.

The window and the tolerance are there because a machine takes time and its
events come one after the other, where the reference has them at one instant. In
the modes threads and kvm a unit takes its real time, and has to be far longer
than the host's noise.

Exit code: 0 none failed, 1 some failed, 2 a file or the command line is refused.
",
};

/// Runs the command with the words after `schedules`.
pub(in crate::oracle) fn command(words: &[OsString]) -> ExitCode {
    IN_KERNEL.carry_out(words, run_files)
}

fn run_files(options: &Parsed) -> Result<ExitCode, Refusal> {
    let settings = settings(options);
    let most_us = settings.unit_us / 4;
    if settings.window_us > most_us || settings.guard_us > most_us {
        return Err(Refusal::Usage(format!(
            "the window and the guard may be a quarter of a unit at most, here {most_us} us"
        )));
    }
    let mut cases = read(options.files(), with_texts).map_err(Refusal::Usage)?;
    let most_cores = options.number("cores-up-to").unwrap_or(MOST_CORES);
    let all = cases.len();
    cases.retain(|(case, _)| u64::from(case.cores) <= most_cores);
    if cases.len() < all {
        let left_out = all - cases.len();
        println!("{left_out} cases for more than {most_cores} cores are left out");
    }
    let (cases, texts): (Vec<Case>, Vec<String>) = cases.into_iter().unzip();
    let failed = report(&run(&cases, &texts, &settings)?, &settings);
    Ok(ExitCode::from(u8::from(failed > 0)))
}

fn settings(options: &Parsed) -> Settings {
    let usual = Settings::for_unit(options.number("unit-us").unwrap_or(10_000));
    let usual = match options.text("work") {
        Some("compute") => usual.computing(),
        _ => usual,
    };
    let mode = options.text("mode").and_then(Mode::from_name);
    let machine = options.text("machine").and_then(Machine::from_name);
    let number = |name: &str, usual| options.number(name).unwrap_or(usual);
    Settings {
        mode: mode.unwrap_or(usual.mode),
        machine: machine.unwrap_or(usual.machine),
        guard_us: number("guard-us", usual.guard_us),
        window_us: number("window-us", usual.window_us),
        tolerance_percent: number("tolerance", usual.tolerance_percent),
        ..usual
    }
}

/// Reads the cases of a file, each also as text.
fn with_texts(text: &str) -> Result<Vec<(Case, String)>, Malformed> {
    let cases = schedules::parse(text)?;
    Ok(cases.into_iter().zip(texts_of_cases(text)).collect())
}

/// Takes a well-formed file apart, one text a case.
#[must_use]
pub fn texts_of_cases(text: &str) -> Vec<String> {
    let mut texts: Vec<String> = Vec::new();
    for line in text.lines() {
        if line.split_whitespace().next() == Some("case") {
            texts.push(String::new());
        }
        if let Some(last) = texts.last_mut() {
            last.push_str(line);
            last.push('\n');
        }
    }
    texts
}

/// Prints what became of the cases and returns how many failed.
fn report(judged: &[Judged], settings: &Settings) -> usize {
    for case in judged {
        if let Err(difference) = &case.outcome {
            println!("{}: {difference}", case.name);
        }
    }
    let passed = |cases: &[Judged]| cases.iter().filter(|case| case.outcome.is_ok()).count();
    for group in judged.chunk_by(|a, b| a.cores == b.cores) {
        let deviations = group.iter().filter_map(|case| case.outcome.clone().ok());
        let of_all = deviations.reduce(Deviation::and).unwrap_or_default();
        println!(
            "{} cores: {} of {} passed; starts and finishes from {:+} to {:+} us of the reference, \
             units of {} us",
            group[0].cores,
            passed(group),
            group.len(),
            of_all.earliest_ns / 1000,
            of_all.latest_ns / 1000,
            settings.unit_us,
        );
    }
    let failed = judged.len() - passed(judged);
    println!("{} passed, {failed} failed", passed(judged));
    failed
}
