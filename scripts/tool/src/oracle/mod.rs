//! The oracle: reference data against the scheduler, its analysis, and the baseline.
//!
//! `oracle KIND FILE...` reads reference files and compares each case with what
//! this project computes. For a failing case the first difference is printed;
//! the last line is `N passed, M failed`. The exit code is 0 if none failed, 1
//! if some did, and 2 if a file could not be read as what it should be, which
//! is said with its line number, and then nothing is compared.
//!
//! - [`bounds`]: the analysis at commit;
//! - [`schedules`]: the scheduler in virtual time;
//! - [`in_kernel`]: the same cases on the bare machine;
//! - [`synchronizer`]: the policies of the publish/subscribe baseline.
//!
//! One kind reads no files: what the analysis accepts of random sets is simulated
//! (`responses`).

pub mod bounds;
pub mod in_kernel;
mod responses;
pub mod schedules;
pub mod synchronizer;
mod table;

use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

use replay::lines::Malformed;

use crate::files;
use crate::options::{Choice, Command, Menu, Refusal};
use crate::progress::Progress;

/// One kind of reference file: how to read its cases and how to check one.
struct Kind<Case> {
    table: &'static Command,
    parse: fn(&str) -> Result<Vec<Case>, Malformed>,
    name: fn(&Case) -> &str,
    check: fn(&Case) -> Result<(), String>,
}

static ORACLE: Menu = Menu {
    invocation: "./scripts/oracle",
    word: "KIND",
    about: "Compares reference cases with what this project computes.",
    choices: &[
        Choice {
            name: "bounds",
            about: "lengths, widths, response-time bounds and verdicts",
            work: |words| {
                let kind = Kind {
                    table: &table::BOUNDS,
                    parse: bounds::parse,
                    name: |case| &case.name,
                    check: bounds::check,
                };
                run_files(&kind, words)
            },
        },
        Choice {
            name: "responses",
            about: "random accepted sets in virtual time, with overheads, against their bounds",
            work: responses::command,
        },
        Choice {
            name: "schedules",
            about: "starts, finishes, preemptions, response times and misses",
            work: |words| {
                if words.iter().any(|word| word == "--in-kernel") {
                    return in_kernel::command(words);
                }
                let kind = Kind {
                    table: &table::SCHEDULES,
                    parse: schedules::parse,
                    name: |case| &case.name,
                    check: schedules::check,
                };
                run_files(&kind, words)
            },
        },
        Choice {
            name: "synchronizer",
            about: "sets that ExactTime and ApproximateTime emit, and what they drop",
            work: |words| {
                let kind = Kind {
                    table: &table::SYNCHRONIZER,
                    parse: synchronizer::parse,
                    name: |case| &case.name,
                    check: synchronizer::check,
                };
                run_files(&kind, words)
            },
        },
    ],
    notes: table::NOTES,
};

/// Runs the subcommand.
#[must_use]
pub fn oracle(words: &[OsString]) -> ExitCode {
    ORACLE.run(words)
}

fn run_files<Case>(kind: &Kind<Case>, words: &[OsString]) -> ExitCode {
    kind.table.carry_out(words, |options| {
        let cases = read(options.files(), kind.parse).map_err(Refusal::Usage)?;
        let mut failed = 0_usize;
        let mut progress = Progress::new(cases.len() as u64, "cases");
        for (over, case) in (1..).zip(&cases) {
            let checked = (kind.check)(case);
            progress.show(over);
            if let Err(difference) = checked {
                failed += 1;
                progress.end();
                println!("{}: {difference}", (kind.name)(case));
            }
        }
        progress.end();
        println!("{} passed, {failed} failed", cases.len() - failed);
        Ok(ExitCode::from(u8::from(failed > 0)))
    })
}

/// Reads the cases of all files, of which there must be one.
fn read<'f, Case>(
    names: impl ExactSizeIterator<Item = &'f Path> + Clone,
    parse: impl Fn(&str) -> Result<Vec<Case>, Malformed>,
) -> Result<Vec<Case>, String> {
    if names.len() == 0 {
        return Err("which files? name at least one reference file".into());
    }
    files::check_once(names.clone())?;
    let mut cases = Vec::new();
    for file in names {
        let place = files::place(file);
        let parsed = parse(&files::read_text(file)?)
            .map_err(|Malformed { line, reason }| format!("{place}:{line}: {reason}"))?;
        cases.extend(parsed);
    }
    Ok(cases)
}
