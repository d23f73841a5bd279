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

pub mod bounds;
pub mod in_kernel;
pub mod schedules;
pub mod synchronizer;

use std::process::ExitCode;

use replay::lines::Malformed;

/// One kind of reference file: how to read its cases and how to check one.
struct Kind<Case> {
    parse: fn(&str) -> Result<Vec<Case>, Malformed>,
    name: fn(&Case) -> &str,
    check: fn(&Case) -> Result<(), String>,
}

const USAGE: &str = "usage: oracle KIND FILE...

Compares reference cases with what this project computes. KIND is one of:
  bounds        lengths, widths, response-time bounds and verdicts
  schedules     starts, finishes, preemptions, response times and misses
                With --in-kernel on the bare machine; see schedules --in-kernel --help
  synchronizer  sets that ExactTime and ApproximateTime emit, and what they drop

Prints the first difference of each failing case, then `N passed, M failed`.
Exit code: 0 none failed, 1 some failed, 2 a file or the command line is refused.
";

/// Runs the subcommand.
#[must_use]
pub fn oracle(words: &[String]) -> ExitCode {
    let on_machine = words.iter().any(|word| word == "--in-kernel");
    if !on_machine && words.iter().any(|word| word == "--help" || word == "-h") {
        print!("{USAGE}");
        return ExitCode::SUCCESS;
    }
    let Some((kind, files)) = words.split_first() else {
        return refuse("which kind of reference file?");
    };
    if kind == "schedules" && files.iter().any(|word| word == "--in-kernel") {
        return in_kernel::command(files);
    }
    match kind.as_str() {
        "bounds" => run_files(
            &Kind {
                parse: bounds::parse,
                name: |case: &bounds::Case| &case.name,
                check: bounds::check,
            },
            files,
        ),
        "schedules" => run_files(
            &Kind {
                parse: schedules::parse,
                name: |case: &schedules::Case| &case.name,
                check: schedules::check,
            },
            files,
        ),
        "synchronizer" => run_files(
            &Kind {
                parse: synchronizer::parse,
                name: |case: &synchronizer::Case| &case.name,
                check: synchronizer::check,
            },
            files,
        ),
        _ => refuse(&format!("no kind of reference file `{kind}`")),
    }
}

fn refuse(reason: &str) -> ExitCode {
    eprint!("oracle: {reason}\n{USAGE}");
    ExitCode::from(2)
}

fn run_files<Case>(kind: &Kind<Case>, files: &[String]) -> ExitCode {
    if files.is_empty() {
        return refuse("which files? name at least one reference file");
    }
    let mut cases = Vec::new();
    for file in files {
        let text = match std::fs::read_to_string(file) {
            Ok(text) => text,
            Err(error) => {
                eprintln!("oracle: cannot read {file}: {error}");
                return ExitCode::from(2);
            }
        };
        match (kind.parse)(&text) {
            Ok(parsed) => cases.extend(parsed),
            Err(Malformed { line, reason }) => {
                eprintln!("oracle: {file}:{line}: {reason}");
                return ExitCode::from(2);
            }
        }
    }
    let mut failed = 0_usize;
    for case in &cases {
        if let Err(difference) = (kind.check)(case) {
            failed += 1;
            println!("{}: {difference}", (kind.name)(case));
        }
    }
    println!("{} passed, {failed} failed", cases.len() - failed);
    ExitCode::from(u8::from(failed > 0))
}
