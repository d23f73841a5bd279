//! The oracle: reference data against the scheduler, its analysis, and the baseline.
//!
//! `oracle KIND FILE...` reads reference files and compares each case with the results of this
//! project. For a failing case the first difference is printed; the last line is `N passed, M
//! failed`. The exit code is 0 if none failed, 1 if some did, and 2 if a file is malformed, which
//! is reported with its line number, and then nothing is compared.
//!
//! - [`assignment`]: cores that are owned and lent;
//! - [`bounds`]: the analysis at commit;
//! - [`schedules`]: the scheduler in virtual time;
//! - [`in_kernel`]: the same cases on the bare machine;
//! - [`synchronizer`]: the policies of the publish/subscribe baseline;
//! - [`waiting`]: schedules and bounds of subtasks that wait, in one file.
//!
//! One kind reads no files: it simulates random sets that the analysis accepts (`responses`).

pub mod assignment;
pub mod bounds;
mod case;
pub mod in_kernel;
pub(crate) mod older_bounds;
mod responses;
pub mod schedules;
pub mod synchronizer;
pub mod waiting;

use std::ffi::OsString;
use std::fmt::Display;
use std::path::Path;
use std::process::ExitCode;

use text::Malformed;

use tool::files;
use tool::options::{Command, Menu, Opt, Refusal, Takes, choices, options};
use tool::progress::Progress;

/// A reader of the cases of one kind.
type Parse<Case> = fn(&str) -> Result<Vec<Case>, Malformed>;

static ORACLE: Menu = Menu {
    invocation: "./scripts/oracle",
    word: "KIND",
    about: "Compares reference cases with what this project computes.",
    choices: choices! {
        "assignment": "attempts, owners, orders, busy times, groups and bounds of lent cores", |words| {
            run_files(words, &ASSIGNMENT, assignment::parse, assignment::check, |case| &case.name)
        };
        "bounds": "lengths, widths, response-time bounds and verdicts", |words| {
            run_files(words, &BOUNDS, bounds::parse, bounds::check, |case| &case.name)
        };
        "responses": "random accepted sets in virtual time, with overheads, against their bounds",
            responses::command;
        "schedules": "starts, finishes, preemptions, response times and misses", |words| {
            if words.iter().any(|word| word == "--in-kernel") {
                return in_kernel::command(words, schedules::parse);
            }
            run_files(words, &SCHEDULES, schedules::parse, schedules::check, |case| &case.name)
        };
        "synchronizer": "sets that ExactTime and ApproximateTime emit, and what they drop", |words| {
            run_files(words, &SYNCHRONIZER, synchronizer::parse, synchronizer::check, |case| &case.name)
        };
        "waiting": "schedules and bounds of subtasks that wait", waiting::command;
    },
    notes: NOTES,
};

/// The part of the help texts that all kinds share.
const NOTES: &str = "\
Prints the first difference of each failing case, then `N passed, M failed`.

Exit code: 0 none failed, 1 some failed, 2 a file or the command line is refused.
";

/// Describes a kind whose reference files are read.
const fn of_files(
    invocation: &'static str,
    about: &'static str,
    options: &'static [Opt],
) -> Command {
    Command {
        invocation,
        about,
        positional: Some((
            Takes::File("FILE..."),
            "Reference files, as in tests/oracle.",
        )),
        options,
        notes: NOTES,
    }
}

static ASSIGNMENT: Command = of_files(
    "./scripts/oracle assignment",
    "Compares how cores are divided among DAGs that own and DAGs that share them, with orders, busy \
     times and bounds, with the division by lent cores.",
    &[],
);

static BOUNDS: Command = of_files(
    "./scripts/oracle bounds",
    "Compares lengths, widths, response-time bounds and verdicts with those of the analysis at \
     commit.",
    &[],
);

static SCHEDULES: Command = of_files(
    "./scripts/oracle schedules",
    "Compares starts, finishes, preemptions, response times and misses with those of the scheduler \
     in virtual time.",
    OPTIONS,
);

options! {
    /// Schedules alone, on the bare machine; with options of its own, see schedules --in-kernel
    /// --help.
    IN_KERNEL: Takes::Nothing;
}

static SYNCHRONIZER: Command = of_files(
    "./scripts/oracle synchronizer",
    "Compares the sets that ExactTime and ApproximateTime emit, and what they drop, with those of \
     the publish/subscribe baseline.",
    &[],
);

/// Runs the subcommand.
pub fn oracle(words: &[OsString]) -> ExitCode {
    ORACLE.run(words)
}

/// Reads the cases of one kind, checks each, and prints the differences by case.
fn run_files<Case>(
    words: &[OsString],
    table: &Command,
    parse: Parse<Case>,
    check: fn(&Case) -> Result<(), String>,
    name: fn(&Case) -> &str,
) -> ExitCode {
    table.carry_out(words, |options| {
        let cases = read(options.files(), parse).map_err(Refusal::Usage)?;
        let mut failed = 0_usize;
        let mut progress = Progress::new(cases.len() as u64, "cases");
        for (over, case) in (1..).zip(&cases) {
            let checked = check(case);
            progress.show(over);
            if let Err(difference) = checked {
                failed += 1;
                progress.wipe();
                // The progress line is gone by now, so the difference has its own line.
                println!("{}: {difference}", name(case));
            }
        }
        progress.wipe();
        println!("{} passed, {failed} failed", cases.len() - failed);
        Ok(ExitCode::from(u8::from(failed > 0)))
    })
}

/// Reads the cases of all files, at least one.
pub(crate) fn read<'f, Case>(
    names: impl ExactSizeIterator<Item = &'f Path> + Clone,
    parse: Parse<Case>,
) -> Result<Vec<Case>, String> {
    if names.len() == 0 {
        return Err("which files? name at least one reference file".into());
    }
    // A file that is given twice would count its cases twice.
    files::check_once(names.clone())?;
    let mut cases = Vec::new();
    for file in names {
        let place = files::shown_path(file);
        let parsed = parse(&files::read_text(file)?)
            .map_err(|Malformed { line, reason }| format!("{place}:{line}: {reason}"))?;
        cases.extend(parsed);
    }
    Ok(cases)
}

/// Compares the expected value of a case with the one found.
fn equal(place: impl Display, what: &str, expected: u64, found: u64) -> Result<(), String> {
    match expected == found {
        true => Ok(()),
        false => Err(format!(
            "{place}: {what}: expected {expected}, found {found}"
        )),
    }
}
