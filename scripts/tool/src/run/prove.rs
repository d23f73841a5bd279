//! `run --observe` and `run --prove`: what calls took, and whether bounds have held.
//!
//! Both boot with the words by which a guest tells its DAGs and its times. `--prove` boots
//! twice: the first run is observed, the second one commits with the WCETs and the overheads
//! that the first has shown, except for what the person states.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::each::{each, worst};
use super::{Booted, RUN, boot_app, check_files, conclude, go_on, prepare};
use crate::dag_file::states_overheads;
use crate::files::{self, Temporary};
use crate::options::{Parsed, Refusal};
use crate::progress::Progress;
use crate::proof::observed::{self, OfDag};
use crate::proof::overheads::{self, Measured};
use crate::proof::{report, wcets};
use crate::protocol::Status;
use crate::record::Record;
use crate::system;

/// What the platform costs; an error in words if no trace was kept.
type Measurement = Result<Measured, String>;

/// Reports whether the options ask for any of this.
pub(super) fn is_asked_for(options: &Parsed) -> bool {
    options.is_given("observe") || options.is_given("prove")
}

/// Does what the options ask for.
pub(super) fn run(options: &Parsed) -> Result<ExitCode, Refusal> {
    if let Some(name) = options.given_of(&["console", "gdb", "print-dag"]) {
        let line = format!("`--{name}` is for a run that is not observed; leave one of them out");
        return Err(Refusal::Usage(line));
    }
    check_files(options)?;
    if !options.is_given("prove") {
        return Ok(match observe(options, options.path("observe"))? {
            Some(_) => ExitCode::SUCCESS,
            None => ExitCode::FAILURE,
        });
    }
    let Some(Proven {
        rows,
        code,
        is_well,
    }) = prove(options)?
    else {
        return Ok(ExitCode::FAILURE);
    };
    say(
        options,
        &report::table(&rows),
        rows.iter().map(report::Row::line),
    );
    match report::complaint(&rows) {
        Some(complaint) if is_well => Err(Refusal::Failure(complaint)),
        _ => Ok(code),
    }
}

/// Proves the DAGs of each file, one after the other, and says all in one table. A file that is
/// refused or fails does not keep the others from being proven.
pub(super) fn of_files(options: &Parsed, files: &[PathBuf]) -> Result<ExitCode, Refusal> {
    let mut progress = Progress::new(files.len() as u64, "files");
    let (mut rows, mut over) = (Vec::new(), 0);
    let (refused, failed) = each(files, |file| {
        progress.show(over);
        over += 1;
        let one = options.with("dag", file).with("quiet", "yes");
        // Neither people nor programs want the lines of each run.
        let one = one.with("json", "yes").with("plain", "yes");
        let Some(proven) = prove(&one)? else {
            return Ok(Status::Failure);
        };
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        rows.extend(proven.rows.into_iter().map(|row| row.of_file(&name)));
        Ok(match proven.is_well {
            true => Status::Success,
            false => Status::Failure,
        })
    })?;
    progress.end();
    say(
        options,
        &report::table(&rows),
        rows.iter().map(report::Row::line),
    );
    if !options.is_given("json") {
        let (count, summary) = (files.len(), report::summary(&rows));
        println!("{count} files: {refused} refused, {failed} failed; {summary}");
    }
    match report::complaint(&rows) {
        Some(complaint) => Err(Refusal::Failure(complaint)),
        None => Ok(worst(refused, failed)),
    }
}

/// The second run of a proof.
struct Proven {
    rows: Vec<report::Row>,
    code: ExitCode,
    is_well: bool,
}

/// Observes a run, commits with what it has shown, and compares; `None` if the first run has
/// failed, which has been said.
fn prove(options: &Parsed) -> Result<Option<Proven>, Refusal> {
    let log = system::new_log("observed")?;
    let own = Temporary(Some(log.with_extension("wcets")));
    let Some(proving) = observe_first(options, own.0.as_deref())? else {
        return Ok(None);
    };
    let dags = prepare(&proving)?;
    let booted = boot_app(&proving, dags.as_ref(), true)?;
    let is_well = booted.outcome.judge().is_ok();
    let code = conclude(&booted, dags.as_ref(), &proving);
    go_on(&booted)?;
    let rows = match compare(&booted).map_err(Refusal::Failure) {
        Ok(rows) => rows,
        // There are worse news.
        Err(_) if !is_well => Vec::new(),
        Err(refusal) => return Err(refusal),
    };
    Ok(Some(Proven {
        rows,
        code,
        is_well,
    }))
}

/// Observes a run, unless the person states both WCETs and overheads, and returns the command
/// line by which the next one commits with what was seen; `None` if the run has failed.
fn observe_first(options: &Parsed, own: Option<&Path>) -> Result<Option<Parsed>, Refusal> {
    let append = options.text("append").unwrap_or_default();
    let measures = !states_overheads(append);
    if options.is_given("wcets") && !measures {
        return Ok(Some(options.clone()));
    }
    let first = options.with("quiet", "yes").with("plain", "yes");
    let file = options.path("observe").or(own);
    let Some(seen) = observe(&first, file.filter(|_| !options.is_given("wcets")))? else {
        return Ok(None);
    };
    let mut next = options.clone();
    if let (Some(file), false) = (file, options.is_given("wcets")) {
        next = next.with("wcets", file);
    }
    if measures {
        let measured = seen?;
        let margin = options.number("margin").unwrap_or(wcets::MARGIN_PERCENT);
        let line = measured.line(margin);
        say(options, &measured.text(margin), [line].into_iter());
        next = next.with("append", format!("{append} {}", measured.word(margin)));
    }
    Ok(Some(next))
}

fn compare(booted: &Booted) -> Result<Vec<report::Row>, String> {
    let record = booted.outcome.record()?;
    let mut all = Vec::new();
    observed::add(&mut all, &record)?;
    report::rows(record.proven()?, &all)
}

/// Observes a run for each seed, says what the calls took, and writes the file of WCETs.
/// Returns what else was seen; `None` if a run has failed, which has been said.
fn observe(options: &Parsed, file: Option<&Path>) -> Result<Option<Measurement>, Refusal> {
    let observing = options.without("prove");
    let observing = observing.with("observe", file.unwrap_or(Path::new("")));
    let first = options.number("seed").unwrap_or(1);
    let seeds = options.number("seeds").unwrap_or(1);
    let mut all: Vec<OfDag> = Vec::new();
    let mut latest = Record::default();
    for seed in first..first.saturating_add(seeds) {
        let one = match seeds {
            1 => observing.clone(),
            _ => observing.with("seed", seed.to_string()),
        };
        let dags = prepare(&one)?;
        let booted = boot_app(&one, dags.as_ref(), true)?;
        let is_well = booted.outcome.judge().is_ok();
        conclude(&booted, dags.as_ref(), &one);
        go_on(&booted)?;
        if !is_well {
            return Ok(None);
        }
        latest = booted.outcome.record()?;
        observed::add(&mut all, &latest)?;
    }
    let margin = options.number("margin").unwrap_or(wcets::MARGIN_PERCENT);
    say(options, &wcets::table(&all, margin), observed::lines(&all));
    if let Some(path) = file {
        let place = files::place(path);
        files::write_named("observe", path, wcets::text(&all, margin))?;
        if options.is_given("observe") && !options.is_given("json") {
            println!("{place}: the WCETs; `--wcets {place}` commits with them");
        }
    }
    // Those of the last seed stand for all.
    Ok(Some(overheads::measure(&latest.runs)))
}

/// Says a table to people and lines to programs, as the options want it.
fn say(options: &Parsed, table: &str, lines: impl Iterator<Item = String>) {
    if !options.is_given("json") {
        print!("{table}");
    }
    if !options.is_given("plain") {
        lines.for_each(|line| println!("{line}"));
    }
}

/// A run that only observes judges no bound: what its WCETs and overheads should be is what it is
/// to show.
pub(super) fn bounds_word(options: &Parsed) -> Option<String> {
    let observes = options.is_given("observe") && !options.is_given("prove");
    observes.then(|| "bounds=observe".into())
}

/// Says what a guest has refused of a file of WCETs, by its name and line.
pub(super) fn refused(options: &Parsed, reason: &str) -> bool {
    let path = options.path("wcets");
    match path.and_then(|path| wcets::translate(reason, path)) {
        Some(line) => {
            RUN.complain(&line);
            true
        }
        None => false,
    }
}
