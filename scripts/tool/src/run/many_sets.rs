//! Runs many sets with `run --on host`: all sets of a file, or of all files of a folder, into a
//! single CSV table.
//!
//! For each processor of this computer, a program runs its share of the next sets. Their rows are
//! printed before the following sets are run. The table has a row for each DAG, with the names of
//! its set and file. A refused set has a single row with the reason, and so has an unreadable file,
//! or a set that ended the program.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::thread::{self, ScopedJoinHandle};
use std::time::Duration;

use fass_dag_file::{DagFile, Length, Set};

use super::several::{FOR_ONE_FILE, worst};
use super::{certificate, name, on_linux, prepare, words};
use crate::dag_file::translate;
use crate::files::{self, TemporaryFile};
use crate::image;
use crate::options::{CommandLine, Refusal};
use crate::program::{self, ProgramOrder};
use crate::progress::Progress;
use crate::system;
use views::protocol::MachineLine;

/// The columns. The file gives the first two, the period and the deadline; the set's verdict and
/// its `dag_set` line give `verdict`, `reason` and `violations`. All others are members of a
/// `dag_run` line with the same names.
const COLUMNS: &str = "file,set,verdict,dag,subtasks,period_ns,relative_deadline_ns,bound_ns,test,\
    not_proven,released,completed,deadline_misses,response_time_ns.min,response_time_ns.median,\
    response_time_ns.p99,response_time_ns.max,tightness_permille,violations,reason";

/// A set to run, or the reasons for refusing a file.
type Part<'f> = (&'f Path, Result<Set, String>);

/// The rows of a part.
struct PartRows {
    verdict: &'static str,
    /// Whether all of the DAGs have bounds.
    is_proven: bool,
    rows: String,
}

/// The most parts run by a single program.
const SHARE: usize = 16;

/// Runs all sets of the files, and prints the table.
pub(super) fn run(options: &CommandLine, files: &[PathBuf]) -> Result<ExitCode, Refusal> {
    let why = "is for one set; name a file of one with `--dag`";
    let apart = [&FOR_ONE_FILE[..], &[name::KEEP, name::JSON]].concat();
    let for_several = options.check_without(&apart, why);
    for_several.map_err(Refusal::Usage)?;
    let (parts, words, length) = read(options, files)?;
    let program = image::build_host().map_err(Refusal::Failure)?;
    let seconds = options.number(name::TIMEOUT).unwrap_or(86_400);
    let run = |share: &[Part<'_>]| run_share(&program, (&words, options, length), seconds, share);
    let processors = thread::available_parallelism().map_or(1, usize::from);
    let mut progress = Progress::new(parts.len() as u64, "sets");
    let mut all = Vec::new();
    println!("{COLUMNS}");
    for next in parts.chunks(SHARE * processors) {
        progress.show(all.len() as u64);
        let shares = next.chunks(next.len().div_ceil(processors));
        let ended: Vec<_> = thread::scope(|scope| {
            let running: Vec<_> = shares.map(|share| scope.spawn(|| run(share))).collect();
            let ended = running.into_iter().map(ScopedJoinHandle::join);
            ended.collect()
        });
        progress.wipe();
        for share in ended {
            let share = share.unwrap_or_else(|_| Err("a thread has panicked".into()));
            let share = share.map_err(Refusal::Failure)?;
            share.iter().for_each(|part| print!("{}", part.rows));
            all.extend(share);
        }
    }
    let count = |verdict| all.iter().filter(|part| part.verdict == verdict).count();
    let (refused, failed) = (count("refused"), count("failed"));
    if !options.is_given(name::QUIET) {
        let (count, proven) = (all.len(), all.iter().filter(|part| part.is_proven).count());
        eprintln!("{count} sets: {proven} proven, {refused} refused, {failed} failed");
    }
    Ok(worst(refused, failed))
}

/// Reads all files. Returns their sets, the words for the program, and the length of a run.
fn read<'f>(
    options: &CommandLine,
    files: &'f [PathBuf],
) -> Result<(Vec<Part<'f>>, Vec<String>, Length), Refusal> {
    let mut progress = Progress::new(files.len() as u64, "files read");
    let (mut parts, mut told) = (Vec::<Part<'f>>::new(), Vec::new());
    let mut length = Length::Jobs(1);
    for (number, file) in (0..).zip(files) {
        progress.show(number);
        match prepare(&options.with(name::DAG, file)) {
            Ok(Some(dags)) => {
                // Length and words follow from the options alone, so they are equal for all files.
                length = dags.length;
                told = words(options, Some(&dags), on_linux::own_words(options));
                parts.extend(dags.file.sets.into_iter().map(|set| (&**file, Ok(set))));
            }
            Ok(None) => {}
            Err(Refusal::Usage(lines)) => parts.push((file, Err(lines.replace('\n', "; ")))),
            Err(other) => return Err(other),
        }
    }
    progress.wipe();
    told.retain(|word| word != "tests=on");
    Ok((parts, told, length))
}

/// Runs parts by a program. Where the program dies at a set, another program goes on behind the
/// set. A program may take up to `seconds` for each of its sets, on average.
fn run_share(
    program: &Path,
    (words, options, length): (&[String], &CommandLine, Length),
    seconds: u64,
    share: &[Part<'_>],
) -> Result<Vec<PartRows>, String> {
    let sets = share.iter().filter_map(|(_, part)| part.clone().ok());
    let texts = sets.map(|mut set| {
        // Explored here, on all processors.
        certificate::give(&mut set, words, options, length);
        DagFile { sets: vec![set] }.to_string()
    });
    let texts: Vec<String> = texts.collect();
    let mut ends = Vec::new();
    while ends.len() < texts.len() {
        let left = &texts[ends.len()..];
        let log = TemporaryFile(Some(system::new_log("dag-file")?));
        let module = TemporaryFile(Some(log.path().with_extension("dags")));
        files::write(module.path(), left.join("\x0c"))?;
        let mut word = OsString::from("module=");
        word.push(module.path());
        let words: Vec<OsString> = words.iter().map(OsString::from).chain([word]).collect();
        let order = ProgramOrder {
            program,
            words: &words,
            is_live: false,
            stops: false,
            log: log.path(),
            limit: Duration::from_secs(seconds.saturating_mul(left.len() as u64)),
        };
        let outcome = program::run(&order, &mut |_| ())?;
        let lines = &outcome.transcript.machine;
        let of_sets = lines.split_inclusive(|line| line.kind == "verdict");
        let is_whole = |lines: &&[MachineLine]| lines.iter().any(|line| line.kind == "verdict");
        ends.extend(
            of_sets
                .filter(is_whole)
                .map(|lines| (lines.to_vec(), String::new())),
        );
        if ends.len() < texts.len() {
            ends.push((Vec::new(), outcome.ending.to_string()));
        }
    }
    let mut ends = ends.into_iter();
    let rows = share.iter().map(|(path, part)| match part {
        Ok(set) => of_set(path, set, &ends.next().unwrap_or_default()),
        Err(lines) => PartRows {
            verdict: "refused",
            is_proven: false,
            rows: row(path, "", "refused", lines, None),
        },
    });
    Ok(rows.collect())
}

/// Returns the rows of a set, made from its machine lines, or from the program's death at the set.
fn of_set(path: &Path, set: &Set, (lines, died): &(Vec<MachineLine>, String)) -> PartRows {
    let of_kind = |kind| lines.iter().filter(move |line| line.kind == kind);
    let end = of_kind("verdict").next();
    let text = |name| end.and_then(|end| end.text_at(name));
    let verdict = match text("status") {
        Some("success") => "ok",
        Some("usage") => "refused",
        _ => "failed",
    };
    let violations = of_kind("dag_set").find_map(|line| line.number_at("violations"));
    let reason = text("reason").unwrap_or(died);
    let sets = vec![set.clone()];
    let of_file = (verdict == "refused").then(|| translate(reason, path, &DagFile { sets }));
    let reason = of_file
        .flatten()
        .map_or(reason.into(), |lines| lines.replace('\n', "; "));
    let of_dags = set.dags.iter().zip(of_kind("dag_run"));
    let of_dags = of_dags.map(|(dag, line)| Some((&dag.spec, line, violations)));
    let mut of_dags: Vec<_> = of_dags.collect();
    let is_proven =
        !of_dags.is_empty() && of_kind("dag_run").all(|line| line.number_at("bound_ns").is_some());
    if of_dags.is_empty() {
        of_dags.push(None);
    }
    let rows = of_dags.into_iter();
    PartRows {
        verdict,
        is_proven,
        rows: rows
            .map(|of| row(path, &set.name, verdict, &reason, of))
            .collect(),
    }
}

/// Returns a row, filled in by the names of the columns.
fn row(
    path: &Path,
    set: &str,
    verdict: &str,
    reason: &str,
    dag: Option<(&sched_dag::DagSpec, &MachineLine, Option<u64>)>,
) -> String {
    let cell = |name: &str| match (name, dag) {
        ("file", _) => files::shown_path(path),
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
    cells.join(",") + "\n"
}

fn number(number: Option<u64>) -> String {
    number.map_or(String::new(), |number| number.to_string())
}

/// Quotes a cell if a CSV reader needs the quotes.
fn quoted(cell: String) -> String {
    match cell.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", cell.replace('"', "\"\"")),
        false => cell,
    }
}
