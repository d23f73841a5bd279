//! Makes several runs: all files of a folder (`--dag FOLDER`), or runs for comparing bounds with
//! response times (`--prove`).
//!
//! An observed guest records its DAGs and times. `--prove` boots twice: the first run is observed,
//! and the second run commits with the WCETs and overheads of the first, unless the person states
//! them.
//!
//! Every file of a folder whose name ends like a DAG file's is run, in the order of the names: one
//! boot for each, or two with `--prove`, in a single table. A file that is refused or fails does
//! not keep the other files from running.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use sched_dag::law::MeasuredCosts;

use super::screen::NOTHING;
use super::{EndedRun, RUN, boot_app, certified, check_files, conclude, go_on, prepare};
use crate::dag_file::{ENDINGS, Format, states_overheads};
use crate::files::{self, TemporaryFile};
use crate::options::{CommandLine, OptionName, Refusal};
use crate::outcome::Outcome;
use crate::output::Table;
use crate::progress::Progress;
use crate::proof::observed::{self, ObservedDag};
use crate::proof::{self, ProofRow};
use crate::run_options::name;
use crate::system;
use views::json::quoted;
use views::protocol::Status;
use views::record::Record;

/// The platform's overheads, or an error in words if no trace was kept.
type Measurement = Result<MeasuredCosts, String>;

/// Proves the DAGs of an app or a file: observes, commits, compares, and prints the table.
pub(super) fn run(options: &CommandLine) -> Result<ExitCode, Refusal> {
    let why = "is for a run that is not observed; leave one of them out";
    let others = [name::CONSOLE, name::GDB, name::PAGE, name::PRINT_DAG];
    let alone = options.check_without(&others, why);
    alone.map_err(Refusal::Usage)?;
    check_files(options)?;
    let Some((rows, code)) = prove(options)? else {
        return Ok(ExitCode::FAILURE);
    };
    say_all(options, &rows);
    match proof::complaint(&rows) {
        // A failed run has been reported; a second message would hide the first.
        Some(complaint) if code == ExitCode::SUCCESS => Err(Refusal::Failure(complaint)),
        _ => Ok(code),
    }
}

/// Proves the DAGs of each file, one file after the other, and prints all results in one table.
/// Goes on with the next file after a refusal or a failure.
pub(super) fn of_files(options: &CommandLine, files: &[PathBuf]) -> Result<ExitCode, Refusal> {
    let mut progress = Progress::new(files.len() as u64, "files");
    let (mut rows, mut over) = (Vec::new(), 0);
    let (refused, failed) = each(files, |file| {
        progress.show(over);
        over += 1;
        let one = options.with(name::DAG, file).with(name::QUIET, NOTHING);
        // The lines of the single runs would drown the table.
        let one = one.with(name::JSON, "yes");
        let Some((proven, code)) = prove(&one)? else {
            return Ok(Status::Failure);
        };
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        rows.extend(proven.into_iter().map(|row| row.of_file(&name)));
        Ok(match code == ExitCode::SUCCESS {
            true => Status::Success,
            false => Status::Failure,
        })
    })?;
    progress.wipe();
    say_all(options, &rows);
    if !options.is_given(name::JSON) {
        let (count, summary) = (files.len(), proof::summary(&rows));
        println!("{count} files: {refused} refused, {failed} failed; {summary}");
    }
    match proof::complaint(&rows) {
        Some(complaint) => Err(Refusal::Failure(complaint)),
        None => Ok(worst(refused, failed)),
    }
}

/// The rows of a proof, and the exit code of its second run.
type Proven = (Vec<ProofRow>, ExitCode);

/// Observes a run, commits with its measurements, and compares. Returns `None` if the first run
/// failed; the failure has been reported.
fn prove(options: &CommandLine) -> Result<Option<Proven>, Refusal> {
    let log = system::new_log("observed")?;
    // The WCETs of the first run.
    let own = TemporaryFile(Some(log.with_extension("wcets")));
    let Some(proving) = observe_first(options, own.path())? else {
        return Ok(None);
    };
    let dags = prepare(&proving)?.map(|dags| certified(&proving, dags));
    let booted = boot_app(&proving, dags.as_ref(), true)?;
    let is_well = booted.outcome.judge().is_ok();
    let code = conclude(&booted, dags.as_ref(), &proving);
    go_on(&booted)?;
    let rows = match compare(&booted).map_err(Refusal::Failure) {
        Ok(rows) => rows,
        // The failed run itself is the worse news.
        Err(_) if !is_well => Vec::new(),
        Err(refusal) => return Err(refusal),
    };
    Ok(Some((rows, code)))
}

/// Observes a run, unless the person states both WCETs and overheads. Returns the command line for
/// the next run, which commits with the measurements. Returns `None` if the run failed.
fn observe_first(options: &CommandLine, own: &Path) -> Result<Option<CommandLine>, Refusal> {
    let append = options.text(name::APPEND).unwrap_or_default();
    let measures = !states_overheads(append);
    if options.is_given(name::WCETS) && !measures {
        return Ok(Some(options.clone()));
    }
    // The person asked for the second run; the first only prepares it.
    let first = options.with(name::QUIET, NOTHING);
    // Observed WCETs do not replace WCETs stated by the person.
    let file = Some(own).filter(|_| !options.is_given(name::WCETS));
    let Some(seen) = observe(&first, file)? else {
        return Ok(None);
    };
    let mut next = options.clone();
    if let Some(file) = file {
        next = next.with(name::WCETS, file);
    }
    if measures {
        let measured = seen?;
        let margin = options.number(name::MARGIN);
        let margin = margin.unwrap_or(observed::MARGIN_PERCENT);
        let word = observed::overheads_word(&measured, margin);
        let with = format!("with a margin of {margin} %");
        let text = format!("\noverheads measured: {measured}; {with}: {word}\n");
        let line = observed::overheads_line(&measured, margin);
        say(options, &text, [line].into_iter());
        next = next.with(name::APPEND, format!("{append} {word}"));
    }
    Ok(Some(next))
}

fn compare(booted: &EndedRun) -> Result<Vec<ProofRow>, String> {
    let record = booted.outcome.record()?;
    let mut all = Vec::new();
    observed::add(&mut all, &record)?;
    proof::rows(record.proven()?, &all)
}

/// Observes a run for each seed, prints the execution times, and writes the file of WCETs. Returns
/// the overheads. Returns `None` if a run failed; the failure has been reported.
fn observe(options: &CommandLine, file: Option<&Path>) -> Result<Option<Measurement>, Refusal> {
    let observing = options.with(name::PROVE, OBSERVING);
    // Saturating, since a person's seed may be the largest `u64`.
    let first = options.number(name::SEED).unwrap_or(1);
    let seeds = options.number(name::SEEDS).unwrap_or(1);
    let mut all: Vec<ObservedDag> = Vec::new();
    let mut latest = Record::default();
    for seed in first..first.saturating_add(seeds) {
        let one = match seeds {
            // An app without draws refuses the word `seed`, so a single run does not get it.
            1 => observing.clone(),
            _ => observing.with(name::SEED, seed.to_string()),
        };
        let dags = prepare(&one)?;
        let booted = boot_app(&one, dags.as_ref(), true)?;
        let is_well = booted.outcome.judge().is_ok();
        conclude(&booted, dags.as_ref(), &one);
        go_on(&booted)?;
        // A failed run may have been cut short, so its times would be too small.
        if !is_well {
            return Ok(None);
        }
        latest = booted.outcome.record()?;
        observed::add(&mut all, &latest)?;
    }
    let margin = options.number(name::MARGIN);
    let margin = margin.unwrap_or(observed::MARGIN_PERCENT);
    let table = observed::table(&all, margin);
    say(options, &table, observed::lines(&all));
    if let Some(path) = file {
        files::write(path, observed::text(&all, margin))?;
    }
    // The overheads in the last seed's run represent all runs.
    Ok(Some(observed::measure(&latest.runs)))
}

/// The value of `--prove` in the first run, which only observes.
const OBSERVING: &str = "observing";

/// Prints the rows of a proof.
fn say_all(options: &CommandLine, rows: &[ProofRow]) {
    let lines = rows.iter().map(ProofRow::line);
    say(options, &proof::table(rows), lines);
}

/// Prints a table for people and lines for programs, as far as the options want them.
fn say(options: &CommandLine, table: &str, lines: impl Iterator<Item = String>) {
    if !options.is_given(name::JSON) {
        print!("{table}");
    }
    if options.text(name::QUIET) != Some(NOTHING) {
        lines.for_each(|line| println!("{line}"));
    }
}

/// Returns the word that keeps a guest from judging bounds while it only observes: its WCETs and
/// overheads are not known yet.
pub(super) fn bounds_word(options: &CommandLine) -> Option<String> {
    let observes = options.text(name::PROVE) == Some(OBSERVING);
    observes.then(|| "bounds=observe".into())
}

/// Reports a guest's refusal of a WCET file with the file's name and line; returns whether the
/// refusal was about that file.
pub(super) fn refused(options: &CommandLine, reason: &str) -> bool {
    let path = options.path(name::WCETS);
    match path.and_then(|path| observed::translate(reason, path)) {
        Some(line) => {
            RUN.report(Refusal::Usage(line));
            true
        }
        None => false,
    }
}

/// Options that make sense for a single file only.
pub(super) const FOR_ONE_FILE: [OptionName; 8] = [
    name::PRINT_DAG,
    name::GRAPH,
    name::TRACE,
    name::SERIAL,
    name::WCETS,
    name::CONSOLE,
    name::GDB,
    name::PAGE,
];

/// Runs all files, going on after refused and failed files. Returns the exit code of the worst
/// file.
pub(super) fn run_folder(options: &CommandLine, folder: &Path) -> Result<ExitCode, Refusal> {
    let why = "is for one file; name one with `--dag`";
    let for_several = options.check_without(&FOR_ONE_FILE, why);
    for_several.map_err(Refusal::Usage)?;
    // Before any boot, so that a folder without files is refused at once.
    let files = files(folder).map_err(Refusal::Usage)?;
    if options.is_given(name::PROVE) {
        return of_files(options, &files);
    }
    let shows_lines = options.is_given(name::JSON);
    let mut table = Table::new("", COLUMNS);
    if !shows_lines {
        print!("{}", table.text());
    }
    let (refused, failed) = each(&files, |file| {
        let one = options.with(name::DAG, file).with(name::QUIET, "yes");
        let dags = prepare(&one)?.map(|dags| certified(&one, dags));
        let booted = boot_app(&one, dags.as_ref(), false)?;
        let judged = booted.outcome.judge();
        let status = judged.map_or_else(|fault| fault.status, |()| Status::Success);
        // The messages of a failed run do not name its file.
        if status == Status::Failure {
            RUN.report(Refusal::Failure(format!("{}:", files::shown_path(file))));
        }
        conclude(&booted, dags.as_ref(), &one);
        go_on(&booted)?;
        if shows_lines {
            lines(file, &booted.outcome).for_each(|line| println!("{line}"));
        } else {
            let cores = options.number(name::CORES).unwrap_or(1);
            add_rows(&mut table, file, cores, &booted.outcome);
            print!("{}", table.text());
        }
        Ok(status)
    })?;
    if !shows_lines {
        let count = files.len();
        println!("{count} files: {refused} refused, {failed} failed");
    }
    Ok(worst(refused, failed))
}

/// Runs each file, going on after a refusal or a failure. Returns the numbers of refused and of
/// failed files.
pub(super) fn each(
    files: &[PathBuf],
    mut run: impl FnMut(&Path) -> Result<Status, Refusal>,
) -> Result<(usize, usize), Refusal> {
    let (mut refused, mut failed) = (0, 0);
    for file in files {
        let status = match run(file) {
            Ok(status) => status,
            Err(Refusal::Usage(lines)) => {
                RUN.report(Refusal::Usage(lines));
                Status::Usage
            }
            Err(Refusal::Failure(line)) => {
                let line = format!("{}: {line}", files::shown_path(file));
                RUN.report(Refusal::Failure(line));
                Status::Failure
            }
            // Ctrl-C ends the whole series, not only this file.
            Err(refusal) => return Err(refusal),
        };
        refused += usize::from(status == Status::Usage);
        failed += usize::from(status == Status::Failure);
    }
    Ok((refused, failed))
}

/// Returns the exit code of the worst of the files.
pub(super) fn worst(refused: usize, failed: usize) -> ExitCode {
    match (refused, failed) {
        (0, 0) => ExitCode::SUCCESS,
        (0, _) => ExitCode::FAILURE,
        _ => ExitCode::from(2),
    }
}

/// Returns the path named by `--dag`, if it is a folder.
pub(super) fn folder(options: &CommandLine) -> Option<PathBuf> {
    let path = options.path(name::DAG)?;
    path.is_dir().then(|| path.to_path_buf())
}

/// Returns the DAG files of a folder.
///
/// # Errors
///
/// In words: the folder cannot be read, or has no DAG file.
pub(super) fn files(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let place = folder.display();
    let entries = fs::read_dir(folder).map_err(|error| format!("{place}: {error}"))?;
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|path| Format::of(path).is_some());
    if files.is_empty() {
        let endings = ENDINGS.join(", .");
        return Err(format!(
            "{place}: the folder has no file .{endings}; name another"
        ));
    }
    // The order of a folder's entries is up to the file system.
    files.sort();
    Ok(files)
}

/// The columns of the table of a folder.
const COLUMNS: &str = "file:<18|dag:<18|subtasks:8|cores:6|jobs:6|misses:8|violations:11|\
                       bound ms:14|max ms:14|max/bound:10";

/// Adds the rows of a file, one for each DAG.
fn add_rows(table: &mut Table, file: &Path, cores: u64, outcome: &Outcome) {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let violations: u64 = outcome
        .transcript
        .of_kind("dag_set")
        .filter_map(|line| line.number_at("violations"))
        .sum();
    for line in outcome.transcript.of_kind("dag_run") {
        let number = |name: &str| line.number_at(name).unwrap_or(0);
        let milliseconds = |ns: Option<u64>| ns.map_or("-".into(), decimal);
        table.row(&[
            &name,
            &line.text_at("dag").unwrap_or("?"),
            &number("subtasks"),
            &cores,
            &number("completed"),
            &number("deadline_misses"),
            &violations,
            &milliseconds(line.number_at("bound_ns")),
            &milliseconds(line.number_at("response_time_ns.max")),
            &proof::ratio(line.number_at("tightness_permille")),
        ]);
    }
}

/// Writes nanoseconds as milliseconds with three places.
fn decimal(ns: u64) -> String {
    let us = ns / 1000;
    format!("{}.{:03}", us / 1000, us % 1000)
}

/// Returns the machine lines of a file's DAGs, each with an additional member naming the file.
fn lines<'o>(file: &Path, outcome: &'o Outcome) -> impl Iterator<Item = String> + use<'o> {
    const BEGINNING: &str = "{\"kind\":\"dag_run\",";
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let name = quoted(&name);
    outcome.serial.lines().filter_map(move |line| {
        // The member goes in first, to keep the rest of the line byte for byte as the guest wrote
        // it.
        let rest = line.strip_prefix(BEGINNING)?;
        Some(format!("{BEGINNING}\"file\":{name},{rest}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::qemu::RunEnd;
    use views::json::{self, Value};

    #[test]
    fn any_name_of_a_file_is_one_member_of_a_machine_line() {
        let serial = "{\"kind\":\"dag_run\",\"dag\":\"x\"}\n";
        let place = Path::new("the log");
        let outcome = Outcome::of(RunEnd::Signal, serial.into(), place, place);
        for name in ["a.dag", "a\nb.dag", "\"\\.dag", "\u{1b}.dag"] {
            let all: Vec<String> = lines(Path::new(name), &outcome).collect();
            assert_eq!(all.concat().lines().count(), 1, "{all:?}");
            let line = json::parse(&all[0]).expect("JSON");
            assert_eq!(line.get("file").and_then(Value::as_text), Some(name));
        }
    }
}
