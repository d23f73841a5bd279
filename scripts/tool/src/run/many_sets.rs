//! `run --on host` with many sets: those of a file, or of all files of a folder, in one CSV.
//!
//! A program for each processor of this computer runs its share of the sets. The table has a row
//! for each DAG, under the set and its file; a set that is refused has one row with the reason, and
//! so has a file that cannot be read.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Mutex;
use std::thread::{self, ScopedJoinHandle};
use std::time::Duration;

use fass_dag_file::{DagFile, Set};

use super::several::{FOR_ONE_FILE, worst};
use super::{name, on_linux, prepare, words};
use crate::dag_file::translate;
use crate::files::{self, Temporary};
use crate::image;
use crate::options::{Parsed, Refusal};
use crate::program::{self, ProgramOrder};
use crate::progress::Progress;
use crate::system;
use views::protocol::MachineLine;

/// The columns: the members of a line `dag_run` under the same names, but for those of the file.
const COLUMNS: &str = "file,set,verdict,dag,subtasks,period_ns,relative_deadline_ns,bound_ns,test,\
    not_proven,released,completed,deadline_misses,response_time_ns.min,response_time_ns.median,\
    response_time_ns.p99,response_time_ns.max,tightness_permille,violations,reason";

/// A set that is run, or the reasons why a file is not.
type Part<'f> = (&'f Path, Result<Set, String>);

/// Runs all sets of the files, and prints the table.
pub(super) fn run(options: &Parsed, files: &[PathBuf]) -> Result<ExitCode, Refusal> {
    let why = "is for one set; name a file of one with `--dag`";
    let apart = [&FOR_ONE_FILE[..], &[name::KEEP, name::JSON]].concat();
    let for_several = options.check_without(&apart, why);
    for_several.map_err(Refusal::Usage)?;
    let (mut parts, mut told) = (Vec::<Part<'_>>::new(), Vec::new());
    for file in files {
        match prepare(&options.with(name::DAG, file)) {
            Ok(Some(dags)) => {
                told = words(options, Some(&dags), on_linux::own_words(options));
                parts.extend(dags.file.sets.into_iter().map(|set| (&**file, Ok(set))));
            }
            Ok(None) => {}
            Err(Refusal::Usage(lines)) => parts.push((file, Err(lines.replace('\n', "; ")))),
            Err(other) => return Err(other),
        }
    }
    let lines = run_sets(options, &parts, told)?;
    let mut of_parts = lines.split_inclusive(|line| line.kind == "verdict");
    println!("{COLUMNS}");
    let (mut refused, mut failed) = (0, 0);
    for (path, part) in &parts {
        let verdict = match part {
            Ok(set) => of_set(path, set, of_parts.next().unwrap_or_default()),
            Err(lines) => {
                row(&files::shown_path(path), "", "refused", lines, None);
                "refused"
            }
        };
        refused += usize::from(verdict == "refused");
        failed += usize::from(verdict == "failed");
    }
    let count = parts.len();
    if !options.is_given(name::QUIET) {
        eprintln!("{count} sets: {refused} refused, {failed} failed");
    }
    Ok(worst(refused, failed))
}

/// Runs the sets by a program for each processor; returns the machine lines of all.
fn run_sets(
    options: &Parsed,
    parts: &[Part<'_>],
    mut words: Vec<String>,
) -> Result<Vec<MachineLine>, Refusal> {
    let sets = parts.iter().filter_map(|(_, part)| part.as_ref().ok());
    let of_set = |set: &Set| {
        DagFile {
            sets: vec![set.clone()],
        }
        .to_string()
    };
    let texts: Vec<String> = sets.map(of_set).collect();
    if texts.is_empty() {
        return Ok(Vec::new());
    }
    words.retain(|word| word != "tests=on");
    let program = image::build_host()?;
    let seconds = options.number(name::TIMEOUT).unwrap_or(86_400);
    let progress = Mutex::new((0, Progress::new(texts.len() as u64, "sets")));
    let run = |texts: &[String]| {
        let log = Temporary(Some(system::new_log("dag-file")?));
        let module = Temporary(Some(log.path().with_extension("dags")));
        files::write(module.path(), texts.join("\x0c"))?;
        let mut words: Vec<OsString> = words.iter().map(OsString::from).collect();
        let mut word = OsString::from("module=");
        word.push(module.path());
        words.push(word);
        let order = ProgramOrder {
            program: &program,
            words: &words,
            is_live: false,
            stops: false,
            log: log.path(),
            limit: Duration::from_secs(seconds),
        };
        let outcome = program::run(&order, &mut |line| {
            if line.starts_with("{\"kind\":\"verdict\"")
                && let Ok(mut progress) = progress.lock()
            {
                progress.0 += 1;
                let over = progress.0;
                progress.1.show(over);
            }
        })?;
        let count = outcome.transcript.of_kind("verdict").count();
        match count == texts.len() {
            true => Ok(outcome.transcript.machine),
            false => Err(format!("{count} sets were run: {}", outcome.ending)),
        }
    };
    let processors = thread::available_parallelism().map_or(1, usize::from);
    let shares = texts.chunks(texts.len().div_ceil(processors));
    let all: Result<Vec<_>, String> = thread::scope(|scope| {
        let running: Vec<_> = shares.map(|share| scope.spawn(|| run(share))).collect();
        let ended = running.into_iter().map(ScopedJoinHandle::join);
        ended
            .map(|lines| lines.unwrap_or_else(|_| Err("a thread has panicked".into())))
            .collect()
    });
    if let Ok((_, progress)) = progress.into_inner() {
        progress.wipe();
    }
    Ok(all.map_err(Refusal::Failure)?.concat())
}

/// Prints the rows of a set; returns its verdict.
fn of_set(path: &Path, set: &Set, lines: &[MachineLine]) -> &'static str {
    let file = &*files::shown_path(path);
    let of_kind = |kind| lines.iter().filter(move |line| line.kind == kind);
    let end = of_kind("verdict").next();
    let text = |name| end.and_then(|end| end.text_at(name)).unwrap_or_default();
    let verdict = match text("status") {
        "success" => "ok",
        "usage" => "refused",
        _ => "failed",
    };
    let violations = of_kind("dag_set").find_map(|line| line.number_at("violations"));
    let reason = text("reason");
    let sets = vec![set.clone()];
    let of_file = (verdict == "refused").then(|| translate(reason, path, &DagFile { sets }));
    let reason = of_file
        .flatten()
        .map_or(reason.into(), |lines| lines.replace('\n', "; "));
    let mut dags = set.dags.iter();
    for line in of_kind("dag_run") {
        let of = dags.next().map(|dag| (&dag.spec, line, violations));
        row(file, &set.name, verdict, &reason, of);
    }
    if of_kind("dag_run").next().is_none() {
        row(file, &set.name, verdict, &reason, None);
    }
    verdict
}

/// Prints a row, by the names of the columns.
fn row(
    file: &str,
    set: &str,
    verdict: &str,
    reason: &str,
    dag: Option<(&sched_dag::DagSpec, &MachineLine, Option<u64>)>,
) {
    let cell = |name: &str| match (name, dag) {
        ("file", _) => file.into(),
        ("set", _) => set.into(),
        ("verdict", _) => verdict.into(),
        ("reason", _) => reason.into(),
        (_, None) => String::new(),
        ("period_ns", Some((spec, ..))) => number(spec.period_ns),
        ("relative_deadline_ns", Some((spec, ..))) => {
            number(spec.relative_deadline_ns.or(spec.period_ns))
        }
        ("violations", Some((.., violations))) => number(violations),
        (name, Some((_, line, _))) => match line.text_at(name) {
            Some(text) => text.into(),
            None => number(line.number_at(name)),
        },
    };
    let cells: Vec<String> = COLUMNS.split(',').map(|name| quoted(cell(name))).collect();
    println!("{}", cells.join(","));
}

fn number(number: Option<u64>) -> String {
    number.map_or(String::new(), |number| number.to_string())
}

/// Quotes a cell if a reader of CSV needs that.
fn quoted(cell: String) -> String {
    match cell.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", cell.replace('"', "\"\"")),
        false => cell,
    }
}
