//! `run --dag FOLDER`: each DAG file of a folder, one boot each, in one table; with `--prove`
//! two boots each.

use std::path::Path;
use std::process::ExitCode;

use super::{RUN, boot_app, conclude, go_on, prepare, prove};
use crate::dag_file::batch;
use crate::files;
use crate::options::{Parsed, Refusal};
use crate::protocol::Status;

/// The options that say something of one run.
const FOR_ONE_FILE: [&str; 10] = [
    "print-dag",
    "graph",
    "trace",
    "serial",
    "dot",
    "witness",
    "observe",
    "wcets",
    "console",
    "gdb",
];

/// Runs all files. A refused or failed one does not keep the others from running;
/// the exit code is that of the worst.
pub(super) fn run(options: &Parsed, folder: &Path) -> Result<ExitCode, Refusal> {
    if let Some(name) = options.given_of(&FOR_ONE_FILE) {
        let line = format!("`--{name}` is for one file; name one with `--dag`");
        return Err(Refusal::Usage(line));
    }
    let files = batch::files(folder).map_err(Refusal::Usage)?;
    if options.is_given("prove") {
        return prove::of_files(options, &files);
    }
    let shows_lines = options.is_given("json");
    if !shows_lines {
        println!("{}", batch::heading());
    }
    let (mut refused, mut failed) = (0, 0);
    for file in &files {
        let place = files::place(file);
        let one = options.with("dag", file).with("quiet", "yes");
        let booted =
            prepare(&one).and_then(|mut dags| Ok((boot_app(&one, dags.as_mut(), false)?, dags)));
        let (booted, dags) = match booted {
            Ok(booted) => booted,
            Err(Refusal::Usage(lines)) => {
                RUN.complain(&lines);
                refused += 1;
                continue;
            }
            Err(Refusal::ByPerson) => return Err(Refusal::ByPerson),
            Err(Refusal::Failure(line)) => {
                RUN.complain(&format!("{place}: {line}"));
                failed += 1;
                continue;
            }
        };
        match booted.outcome.judge() {
            Ok(()) => {}
            Err(fault) if fault.status == Status::Usage => refused += 1,
            Err(_) => {
                RUN.complain(&format!("{place}:"));
                failed += 1;
            }
        }
        conclude(&booted, dags.as_ref(), &one);
        go_on(&booted)?;
        if shows_lines {
            batch::lines(file, &booted.outcome).for_each(|line| println!("{line}"));
        } else {
            let cores = options.number("cores").unwrap_or(1);
            print!("{}", batch::rows(file, cores, &booted.outcome));
        }
    }
    if !shows_lines {
        let count = files.len();
        println!("{count} files: {refused} refused, {failed} failed");
    }
    Ok(match (refused, failed) {
        (0, 0) => ExitCode::SUCCESS,
        (0, _) => ExitCode::FAILURE,
        _ => ExitCode::from(2),
    })
}
