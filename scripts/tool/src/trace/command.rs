//! The subcommand `check-trace`: from files to an exit code.
//!
//! All files are read before the first run is judged, so that a damaged one
//! does not hide behind the breaches of another.

use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

use super::chains::Measured;
use super::{chains, check, report};
use crate::files;
use crate::options::{Command, Parsed, Refusal, Takes, options};
use crate::record::Record;
use crate::record::{Run, bound};

/// The table of `check-trace`.
pub static CHECK_TRACE: Command = Command {
    invocation: "./scripts/check-trace",
    about: "Replays the traces of runs against the model's rules and reports each breach.",
    positional: Some((
        Takes::File("FILE..."),
        "Serial logs, or other files of JSON lines, with traces: \
         `./scripts/run --trace FILE` makes one.",
    )),
    options: options! {
        /// Microseconds for which an instance may wait for what it is owed, because a decision
        /// takes effect after an interrupt; 50 in mode deterministic, on Linux 5000 by fifo, 10000
        /// by sched_ext, 100000 where nothing is preempted, else 1000.
        "bound-us": Takes::number(0..=1_000_000_000);
        /// Breaches of a run to be shown; all are counted.
        "show": Takes::number(0..=u64::MAX), or "20";
        /// Only the chains that begin with this subtask; with --to.
        "from": Takes::Text("DAG/SUBTASK");
        /// Only the chains that end with this subtask; with --from.
        "to": Takes::Text("DAG/SUBTASK");
        /// Only the machine lines on standard output, the rest on standard error.
        "json": Takes::Nothing;
    },
    notes: "\
rules:
  R1 release              nothing of a job before O + kT
  R2 join                 after all predecessors and the subtask's own job before
  R3 completion boundary  all that waits for a finish is released in its step
  R4 completion           complete with the last finish; missed if that is late
  R5 dispatch             the smallest keys run; no core idles while one waits
  one life                an instance starts and finishes once, on one core at a time
  one core                a core runs one instance at a time

chains: from a source to a sink, from DAG to DAG by samples of latest values
  age of an output        from the release that it goes back to, to its finish
  data age                the same, to the finish of the next output
  reaction time           from what a release just misses to the first output of it

For each run there is a machine line of kind `trace_check`, and one of kind `chain`
for each chain; docs/trace-format.md explains them.

exit codes: 0 no breach; 1 some; 2 a refused command line, or a file without a
well-formed trace with events
",
};

/// Runs the subcommand with the words after its name.
#[must_use]
pub fn check_trace(words: &[OsString]) -> ExitCode {
    CHECK_TRACE.carry_out(words, |options| {
        let breaches = judge_all(options).map_err(Refusal::Usage)?;
        Ok(ExitCode::from(u8::from(breaches > 0)))
    })
}

/// Judges the runs of all files, and returns how many breaches there are.
fn judge_all(options: &Parsed) -> Result<usize, String> {
    if options.files().len() == 0 {
        return Err("which files? name at least one serial log with a trace".into());
    }
    files::check_once(options.files())?;
    let mut runs = Vec::new();
    for file in options.files() {
        let found = read_file(file)?.into_iter();
        runs.extend(found.map(|run| (files::place(file), run)));
    }
    // A wrong name is told before anything is shown.
    let measured = runs.iter().map(|(_, run)| chains::measure(run, options));
    let measured: Vec<_> = measured.collect::<Result<_, _>>()?;
    let judged = runs.iter().zip(&measured);
    let breaches = judged.map(|((file, run), chains)| judge(file, run, chains, options));
    Ok(breaches.sum())
}

/// Reads a file's runs, of which at least one must have events.
pub(super) fn read_file(path: &Path) -> Result<Vec<Run>, String> {
    let file = files::place(path);
    let bytes = files::read(path).map_err(|why| format!("{file}: {why}; name another file"))?;
    let runs = Record::read(&bytes)
        .map_err(|why| format!("{file}: {why}"))?
        .runs;
    match &runs[..] {
        [] => Err(format!(
            "{file}: there is no run in it; `./scripts/run --trace FILE` keeps one"
        )),
        runs if runs.iter().all(|run| run.events.is_empty()) => {
            Err(format!("{file}: no run of the file has an event"))
        }
        _ => Ok(runs),
    }
}

/// Checks a run, prints what was found, and returns the number of breaches.
fn judge(file: &str, run: &Run, chains: &[Measured], options: &Parsed) -> usize {
    let bound_ns = bound::of(run, options);
    let shown = options.number("show").unwrap_or(u64::MAX);
    let shown = usize::try_from(shown).unwrap_or(usize::MAX);
    let findings = check(run, bound_ns);
    let mut table = report::table(file, run, &findings, bound_ns, shown);
    table += &chains::table(run, chains, options.is_given("from"));
    if options.is_given("json") {
        eprint!("{table}");
    } else {
        print!("{table}");
    }
    println!("{}", report::machine_line(file, run, &findings));
    for chain in chains {
        println!("{}", chains::machine_line(file, run, chain));
    }
    findings.breaches.len()
}
