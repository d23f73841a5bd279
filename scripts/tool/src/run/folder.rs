//! `run --dag FOLDER`: each DAG file of a folder, one boot each, in one table; with `--prove`
//! two boots each.

use std::path::Path;
use std::process::ExitCode;

use super::each::{each, worst};
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
    let (refused, failed) = each(&files, |file| {
        let one = options.with("dag", file).with("quiet", "yes");
        let dags = prepare(&one)?;
        let booted = boot_app(&one, dags.as_ref(), false)?;
        let judged = booted.outcome.judge();
        let status = judged.map_or_else(|fault| fault.status, |()| Status::Success);
        if status == Status::Failure {
            RUN.complain(&format!("{}:", files::place(file)));
        }
        conclude(&booted, dags.as_ref(), &one);
        go_on(&booted)?;
        if shows_lines {
            batch::lines(file, &booted.outcome).for_each(|line| println!("{line}"));
        } else {
            let cores = options.number("cores").unwrap_or(1);
            print!("{}", batch::rows(file, cores, &booted.outcome));
        }
        Ok(status)
    })?;
    if !shows_lines {
        let count = files.len();
        println!("{count} files: {refused} refused, {failed} failed");
    }
    Ok(worst(refused, failed))
}
