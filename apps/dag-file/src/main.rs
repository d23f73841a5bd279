//! Boots into the DAGs of the file that the loader left in memory.

#![no_std]
#![no_main]

extern crate alloc;

mod report;

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

use dag_file::{DagFile, Execution, Length, Settings, build, check, parse};
use fass::{ConstructionPolicy, Occupation, finish_create_dags_with};
use kernel::options::UsageError;
use kernel::{Ending, Machine, println};
use replay::{Epoch, Scale};
use sched_dag::{CommitOptions, Policy};

use report::Report;

kernel::entry!(main);

/// The app's words of the command line.
const WORDS: [&str; 11] = [
    "overheads",
    "overheads_margin",
    "clusters",
    "execution",
    "seed",
    "jobs",
    "seconds",
    "occupy",
    "grid_ns",
    "deadlines",
    "show",
];

/// Time for the cores to get ready.
const LEAD_NS: u64 = 1_000_000;

/// What the command line says besides how a set is run.
struct Wishes {
    settings: Settings,
    /// Whether a deadline miss makes the run a failure.
    is_strict: bool,
    /// Whether people want to read, or only programs.
    for_people: bool,
}

fn main(machine: &Machine) -> Result<(), Ending> {
    machine.offer_overheads()?;
    machine.offer_clusters()?;
    let wishes = wishes(machine)?;
    let file = read(machine, wishes.settings.length)?;
    let mut reports = Vec::new();
    for set in &file.sets {
        let (settings, epoch) = (&wishes.settings, Epoch::default());
        let dags = build(set, settings, &epoch);
        // What is wrong with the DAGs is wrong with the file that we were given.
        let commit = finish_create_dags_with(&dags, ConstructionPolicy::any_graph())
            .map_err(|error| usage(format!("DAG file: {error}")))?;
        if wishes.for_people {
            for warning in commit.warnings() {
                println!("warning: {warning}");
            }
        }
        let epoch_ns = fass::now_ns() + LEAD_NS;
        epoch.set(epoch_ns);
        let run = machine.run_from(epoch_ns)?;
        let report = Report::new(set, commit.answers(), &run);
        report.emit();
        reports.push(report);
    }
    if wishes.for_people {
        reports.iter().for_each(Report::print_table);
    }
    machine.report_memory();
    let complaint = |report: &Report| report.complaint(wishes.is_strict);
    let complaint = reports.iter().find_map(complaint);
    complaint.map_or(Ok(()), |text| Err(Ending::Failure(text)))
}

fn usage(message: impl Into<String>) -> Ending {
    Ending::Usage(UsageError::new(message))
}

/// Reads the loader's file, and checks all of it before anything runs.
fn read(machine: &Machine, length: Length) -> Result<DagFile, Ending> {
    let module = machine
        .module()
        .ok_or_else(|| usage("no DAG file; give one with `qemu -initrd FILE`"))?;
    let text = core::str::from_utf8(module).map_err(|error| {
        let line = 1 + newlines(&module[..error.valid_up_to()]);
        usage(format!("DAG file, line {line}: it is not UTF-8 text"))
    })?;
    let file = parse(text).map_err(|malformed| usage(format!("DAG file, {malformed}")))?;
    // Attributes are needed under static priorities only, so that asks for more.
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

fn wishes(machine: &Machine) -> Result<Wishes, Ending> {
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
        (_, None) => Length::Jobs(options.number("jobs", 1..=1_000_000, 50)?),
    };
    let grid_ns = options.number("grid_ns", 0..=10_000_000_000, 0)?;
    let grid = (grid_ns > 0).then_some(Scale {
        unit_ns: grid_ns,
        guard_ns: grid_ns / 500,
    });
    machine.set_coincidence(core::time::Duration::from_nanos(grid_ns / 100));
    let occupations = [("hold", Occupation::Hold), ("spin", Occupation::Spin)];
    let wishes = Wishes {
        settings: Settings {
            execution,
            seed: options.number("seed", 0..=u64::MAX, 1)?,
            occupation: options.choice("occupy", &occupations)?,
            length,
            grid,
        },
        is_strict: options.choice("deadlines", &[("count", false), ("strict", true)])?,
        for_people: options.choice("show", &[("all", true), ("lines", false)])?,
    };
    options.finish(&WORDS)?;
    Ok(wishes)
}
