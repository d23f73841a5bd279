//! Boots into the DAGs of a file left in memory by the loader.

#![no_std]
#![no_main]

extern crate alloc;

mod report;

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::time::Duration;

use dag_file::{RunSettings, commit};
use fass::Occupation;
use fass::commit::DagAnswer;
use fass_dag_file::{DagFile, Execution, Length, check, parse};
use kernel::options::UsageError;
use kernel::{AppError, Machine, println};
use sched_dag::{CommitOptions, Policy};

use report::SetReport;

kernel::entry!(main);

/// The app's options on the command line.
const WORDS: [&str; 11] = [
    "overheads",
    "overheads_margin",
    "clusters",
    "execution",
    "seed",
    "jobs",
    "seconds",
    "occupy",
    "deadlines",
    "grid_us",
    "window_us",
];

/// Options of the command line besides the settings of a set's run.
struct CommandOptions {
    settings: RunSettings,
    /// Whether a deadline miss makes the run a failure.
    is_strict: bool,
}

fn main(machine: &Machine) -> Result<(), AppError> {
    machine.offer_overheads()?;
    machine.offer_clusters()?;
    let wishes = wishes(machine)?;
    let file = read(machine, wishes.settings.length)?;
    let mut reports = Vec::new();
    for set in &file.sets {
        // A person may pause DAGs.
        let certificate = if machine.has_console() {
            ""
        } else {
            &set.certificate
        };
        machine.fix(certificate);
        // Faults of the DAGs are faults of the given file.
        let commit =
            commit(set, &wishes.settings).map_err(|error| usage(format!("DAG file: {error}")))?;
        for warning in commit.warnings() {
            println!("warning: {warning}");
        }
        let is_placed = |answer: &&DagAnswer| {
            let is_chosen = answer.cluster.as_ref().is_some_and(|of| of.why.is_some());
            is_chosen || answer.table.is_some()
        };
        for answer in commit.answers().iter().filter(is_placed) {
            println!("{answer}");
        }
        let run = match wishes.settings.grid_ns {
            0 => machine.run()?,
            grid_ns => machine.run_from((fass::now_ns() / grid_ns + 2) * grid_ns)?,
        };
        let report = SetReport::new(set, commit.answers(), &run);
        report.emit();
        reports.push(report);
    }
    reports.iter().for_each(SetReport::print_table);
    machine.report_memory();
    let complaint = |report: &SetReport| report.complaint(wishes.is_strict);
    let complaint = reports.iter().find_map(complaint);
    complaint.map_or(Ok(()), |text| Err(AppError::Failure(text)))
}

fn usage(message: impl Into<String>) -> AppError {
    AppError::Usage(UsageError::new(message))
}

/// Reads the loader's file, and checks the whole file before anything runs.
fn read(machine: &Machine, length: Length) -> Result<DagFile, AppError> {
    let module = machine
        .module()
        .ok_or_else(|| usage("no DAG file; give one with `qemu -initrd FILE`"))?;
    let text = core::str::from_utf8(module).map_err(|error| {
        let line = 1 + newlines(&module[..error.valid_up_to()]);
        usage(format!("DAG file, line {line}: it is not UTF-8 text"))
    })?;
    let file = parse(text).map_err(|malformed| usage(format!("DAG file, {malformed}")))?;
    // Only static priorities need all attributes, so a check under them asks for the most.
    let whole = CommitOptions::new(Policy::StaticPriority, machine.cores());
    let options = whole.with_clusters(machine.clusters());
    for set in &file.sets {
        check(set, &options, length).map_err(|faults| {
            let faults: Vec<String> = faults.iter().map(ToString::to_string).collect();
            usage(format!("DAG file, {}", faults.join("; ")))
        })?;
    }
    Ok(file)
}

fn newlines(bytes: &[u8]) -> usize {
    bytes.iter().filter(|byte| **byte == b'\n').count()
}

fn wishes(machine: &Machine) -> Result<CommandOptions, AppError> {
    let options = machine.options();
    let execution = options
        .text("execution")
        .map_or(Ok(Execution::Wcet), |text| {
            Execution::parse(text).map_err(|message| usage(format!("`execution`: {message}")))
        })?;
    let length = match (options.text("jobs"), options.text("seconds")) {
        (Some(_), Some(_)) => {
            return Err(usage("`jobs` and `seconds` exclude each other; give one"));
        }
        (None, Some(_)) => {
            let seconds = options.number("seconds", 1..=1_000_000_000, 1)?;
            Length::Span(seconds * 1_000_000_000)
        }
        (Some(_), None) => Length::Jobs(options.number("jobs", 1..=1_000_000, 1)?),
        (None, None) => Length::Periods(50),
    };
    let occupations = [("hold", Occupation::Hold), ("spin", Occupation::Spin)];
    let wishes = CommandOptions {
        settings: RunSettings {
            execution,
            seed: options.number("seed", 0..=u64::MAX, 1)?,
            occupation: options.choice("occupy", &occupations)?,
            length,
            grid_ns: options.number("grid_us", 0..=10_000_000, 0)? * 1000,
        },
        is_strict: options.choice("deadlines", &[("count", false), ("strict", true)])?,
    };
    // Schedules are compared with those of a model with these two: see `Machine::set_coincidence`.
    let window_us = options.number("window_us", 0..=10_000_000, 0)?;
    machine.set_coincidence(Duration::from_micros(window_us));
    options.finish(&WORDS)?;
    Ok(wishes)
}
