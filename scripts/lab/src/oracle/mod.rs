//! The oracle: compares reference data with the scheduler, its analysis, and the baseline.
//!
//! `oracle KIND FILE...` reads reference files and compares each case with this project's results.
//! For a failing case the first difference is printed; the last line is `N passed, M failed`. The
//! exit code is 0 if no case failed and 1 if some did. A malformed file is reported with the line
//! number: nothing is compared, and the exit code is 2.
//!
//! - [`assignment`]: owned and lent cores;
//! - [`bounds`]: the analysis at commit;
//! - `graph`: closed lists of a schedule-abstraction graph;
//! - [`schedules`]: the scheduler in virtual time;
//! - [`in_kernel`]: the same cases on the bare machine;
//! - [`one_core`]: response times on one core;
//! - [`synchronizer`]: the policies of the publish/subscribe baseline;
//! - [`waiting`]: schedules and bounds of subtasks with waits, in a single file.
//!
//! The kind `responses` reads no files: it simulates random sets that the analysis accepts.

pub mod assignment;
pub mod bounds;
mod case;
mod graph;
pub mod in_kernel;
pub(crate) mod older_bounds;
pub mod one_core;
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
use tool::options::{Command, Refusal, ValueKind, WordMenu, choices, options};
use tool::progress::Progress;

/// A reader of the cases of one kind.
type Parse<Case> = fn(&str) -> Result<Vec<Case>, Malformed>;

static ORACLE: WordMenu = WordMenu {
    invocation: "./scripts/oracle",
    word: "KIND",
    about: "Compares reference cases with what this project computes.",
    choices: choices! {
        "assignment": "attempts, tables, busy times, groups and bounds of divided cores",
            |words| assignment::ORACLE.run(words);
        "bounds": "lengths, widths, response-time bounds and verdicts",
            |words| bounds::ORACLE.run(words);
        "graph": "schedule-abstraction graphs: verdicts, and bounds of sinks",
            |words| graph::ORACLE.run(words);
        "one-core": "response times on one core", |words| one_core::ORACLE.run(words);
        "responses": "random accepted sets in virtual time, with overheads, against their bounds",
            responses::command;
        "schedules": "starts, finishes, preemptions, response times and misses",
            |words| schedules::ORACLE.run(words);
        "synchronizer": "sets that ExactTime and ApproximateTime emit, and what they drop",
            |words| synchronizer::ORACLE.run(words);
        "waiting": "schedules and bounds of subtasks that wait", |words| waiting::ORACLE.run(words);
    },
    notes: NOTES,
};

/// The part of the help texts that all kinds share.
const NOTES: &str = "\
Prints the first difference of each failing case, then `N passed, M failed`.

Exit code: 0 none failed, 1 some failed, 2 a file or the command line is refused.
";

options! {
    /// Schedules alone, on the bare machine; with options of its own, see schedules --in-kernel
    /// --help.
    IN_KERNEL: ValueKind::Nothing;
}

/// Runs the subcommand `oracle` with the words after its name.
pub fn oracle(words: &[OsString]) -> ExitCode {
    ORACLE.run(words)
}

/// A kind with cases from reference files.
struct FileOracle<Case: 'static> {
    /// The command as typed by a person.
    invocation: &'static str,
    about: &'static str,
    parse: Parse<Case>,
    /// Compares a case, and returns the first difference.
    check: fn(&Case) -> Result<(), String>,
    name: fn(&Case) -> &str,
    /// Reads only the schedules, which may run on the bare machine; `None` if there are none.
    schedules: Option<Parse<schedules::Case>>,
}

impl<Case> FileOracle<Case> {
    /// Reads the cases, checks each, and prints the differences by case.
    fn run(&self, words: &[OsString]) -> ExitCode {
        let in_kernel = words.iter().any(|word| word == "--in-kernel");
        if let Some(parse) = self.schedules.filter(|_| in_kernel) {
            return in_kernel::command(words, parse);
        }
        let files = "Reference files, as in tests/oracle.";
        let table = Command {
            invocation: self.invocation,
            about: self.about,
            positional: Some((ValueKind::File("FILE..."), files)),
            options: self.schedules.map_or(&[], |_| OPTIONS),
            notes: NOTES,
        };
        table.carry_out(words, |options| {
            let cases = read(options.files(), self.parse).map_err(Refusal::Usage)?;
            let mut failed = 0_usize;
            let mut progress = Progress::new(cases.len() as u64, "cases");
            for (over, case) in (1..).zip(&cases) {
                let checked = (self.check)(case);
                progress.show(over);
                if let Err(difference) = checked {
                    failed += 1;
                    progress.wipe();
                    // The progress line is gone by now, so the difference has its own line.
                    println!("{}: {difference}", (self.name)(case));
                }
            }
            progress.wipe();
            println!("{} passed, {failed} failed", cases.len() - failed);
            Ok(ExitCode::from(u8::from(failed > 0)))
        })
    }
}

/// Reads the cases of all files; there must be at least one file.
pub(crate) fn read<'f, Case>(
    names: impl ExactSizeIterator<Item = &'f Path> + Clone,
    parse: Parse<Case>,
) -> Result<Vec<Case>, String> {
    if names.len() == 0 {
        return Err("which files? name at least one reference file".into());
    }
    // A file given twice would have its cases counted twice.
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

/// Compares the expected value of a case with the found value.
fn equal(place: impl Display, what: &str, expected: u64, found: u64) -> Result<(), String> {
    match expected == found {
        true => Ok(()),
        false => Err(format!(
            "{place}: {what}: expected {expected}, found {found}"
        )),
    }
}

#[cfg(test)]
mod judged {
    use super::FileOracle;
    use crate::tests::{altered, rows};

    /// Makes sure that a file has `count` cases, and that all agree.
    pub(super) fn assert_agree<Case>(oracle: &FileOracle<Case>, text: &str, count: usize) {
        let cases = (oracle.parse)(text).unwrap();
        assert_eq!(cases.len(), count);
        for case in &cases {
            assert_eq!((oracle.check)(case), Ok(()), "{}", (oracle.name)(case));
        }
    }

    /// Makes sure that alterations make a text's first case differ. Each row holds a part, its
    /// replacement, and the expected difference.
    pub(super) fn assert_differs<Case>(oracle: &FileOracle<Case>, text: &str, table: &str) {
        for [from, to, difference] in rows(table) {
            let cases = (oracle.parse)(&altered(text, [&from, &to])).expect("still well formed");
            assert_eq!((oracle.check)(&cases[0]), Err(difference), "{to}");
        }
    }
}
