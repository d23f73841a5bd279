//! Draws runs: the command `trace`.

use std::ffi::OsString;
use std::fs;
use std::process::ExitCode;

use views::links;
use views::picture::{self, TimeWindow, WindowRequest};
use views::record::tolerance_ns;
use views::view::View;

use super::{perfetto, read_files};
use crate::files::{self, NamedFile};
use crate::options::{Command, CommandLine, Refusal, ValueKind, options};

/// The options and the help text of `trace`.
pub static TRACE: Command = Command {
    invocation: "./scripts/trace",
    about: "Draws the traces of runs: for Perfetto's viewer, or as one picture.",
    positional: Some((
        ValueKind::File("FILE..."),
        "A record of runs, as `./scripts/run --trace FILE` and --keep write it, or a serial log; or \
         records of machines that send each other messages.",
    )),
    options: OPTIONS,
    notes: "\
Open the file at https://ui.perfetto.dev (it stays on your machine), or in Chromium at
chrome://tracing. docs/watching.md explains the picture.

exit codes: 0 all is well; 1 the output cannot be written; 2 a refused command
line, or a file without a well-formed trace with events
",
};

options! {
    /// Write to this file; else to standard output.
    OUT 'o': ValueKind::File("FILE");
    /// Draw one run as an SVG instead: its DAGs above their schedule, with bounds and deadlines.
    SVG: ValueKind::Nothing;
    /// How many times the longest period the picture shows.
    PERIODS: ValueKind::Number(1, 1000), or "1";
    /// The picture begins at this time of the run, such as 20ms; else at 0, or where
    /// machines first hear of each other.
    FROM: ValueKind::Text("TIME");
    /// It shows the jobs that are released before this time, whatever --periods says.
    TO: ValueKind::Text("TIME");
    /// Only these DAGs, with commas between; else all of them.
    DAGS: ValueKind::Text("NAMES");
    /// Only the run of this number; else all of them, side by side from time 0.
    RUN: ValueKind::Number(0, u64::MAX);
    /// As for ./scripts/check-trace, whose breaches are shown as markers.
    BOUND_US: ValueKind::Number(0, 1_000_000_000);
}

/// Runs the subcommand with the words after its name.
pub fn trace(words: &[OsString]) -> ExitCode {
    TRACE.carry_out(words, |options| {
        let text = draw(options).map_err(Refusal::Usage)?;
        match options.path(name::OUT) {
            None => print!("{text}"),
            Some(out) => {
                let place = files::shown_path(out);
                fs::write(out, text).map_err(|error| format!("cannot write {place}: {error}"))?;
                let by = match options.is_given(name::SVG) {
                    true => "in a browser",
                    false => "at https://ui.perfetto.dev",
                };
                eprintln!("{place}: open it {by}");
            }
        }
        Ok(ExitCode::SUCCESS)
    })
}

/// Converts the runs named by the options.
fn draw(options: &CommandLine) -> Result<String, String> {
    options.file("which file? name a record of a run")?;
    let inputs = options.files().map(|path| NamedFile { option: "", path });
    files::check(&inputs.collect::<Vec<_>>(), &options.named(&[name::OUT]))?;
    let mut records = read_files(options)?;
    let joint = links::join(&records)?;
    let (file, first) = records.swap_remove(0);
    let mut runs = match joint {
        Some(run) => vec![run],
        None if records.is_empty() => first.runs,
        None => return Err("no messages connect these records; draw each alone".into()),
    };
    if let Some(number) = options.number(name::RUN) {
        let there: Vec<String> = runs.iter().map(|run| run.number.to_string()).collect();
        runs.retain(|run| run.number == number);
        if runs.is_empty() {
            let there = there.join(", ");
            return Err(format!(
                "`--run {number}`: {file} has no such run; its runs are {there}"
            ));
        }
    }
    if runs.iter().any(|run| !run.complete) {
        eprintln!("{file}: the record ends before the run");
    }
    if options.is_given(name::SVG) {
        // A picture has only one axis of time, so without `--run` it shows the first run.
        let run = runs.first().ok_or("the file has no run")?;
        let view = View::new(run);
        let asked = WindowRequest {
            from: options.text(name::FROM),
            to: options.text(name::TO),
            dags: options.text(name::DAGS),
            periods: options.number(name::PERIODS),
        };
        return picture::draw(&view, TimeWindow::of(&view, &asked)?);
    }
    // All runs of a file come from the same boot, so the same bound holds for all.
    let of_first = |run| tolerance_ns(run, options.number(name::BOUND_US));
    let bound_ns = runs.first().map_or(0, of_first);
    Ok(perfetto::convert(&runs, bound_ns))
}
