//! The subcommand `trace`: from a log to a file for a viewer.

use std::ffi::OsString;
use std::fs;
use std::process::ExitCode;

use super::convert;
use crate::files;
use crate::options::{Command, Parsed, Refusal, Takes, options};
use crate::record::bound;
use crate::trace::command::read_file;

/// The table of `trace`.
pub static TRACE: Command = Command {
    invocation: "./scripts/trace",
    about: "Converts the traces of runs for Perfetto's viewer.",
    positional: Some((
        Takes::File("FILE"),
        "A serial log, or another file of JSON lines, with traces: \
         `./scripts/run --trace FILE` makes one.",
    )),
    options: options! {
        /// Write to this file; else to standard output.
        "out" 'o': Takes::File("FILE");
        /// Only the run of this number; else all of them, side by side from time 0.
        "run": Takes::number(0..=u64::MAX);
        /// As for ./scripts/check-trace, whose breaches are shown as markers.
        "bound-us": Takes::number(0..=1_000_000_000);
    },
    notes: "\
Open the file at https://ui.perfetto.dev (it stays on your machine), in Chromium at
chrome://tracing, or at https://www.speedscope.app. docs/seeing.md explains the picture.

exit codes: 0 all is well; 1 the output cannot be written; 2 a refused command
line, or a file without a well-formed trace with events
",
};

/// Runs the subcommand with the words after its name.
#[must_use]
pub fn trace(words: &[OsString]) -> ExitCode {
    TRACE.carry_out(words, |options| {
        let text = draw(options).map_err(Refusal::Usage)?;
        match options.path("out") {
            None => print!("{text}"),
            Some(out) => {
                let place = files::place(out);
                fs::write(out, text).map_err(|error| format!("cannot write {place}: {error}"))?;
                eprintln!("{place}: open it at https://ui.perfetto.dev");
            }
        }
        Ok(ExitCode::SUCCESS)
    })
}

/// Converts the runs that the options ask for.
fn draw(options: &Parsed) -> Result<String, String> {
    let input = options.file("which file? name a serial log with a trace")?;
    files::check(&[input], &options.named(&["out"]))?;
    let mut runs = read_file(input.path)?;
    let file = files::place(input.path);
    if let Some(number) = options.number("run") {
        let there: Vec<String> = runs.iter().map(|run| run.number.to_string()).collect();
        runs.retain(|run| run.number == number);
        if runs.is_empty() {
            let there = there.join(", ");
            return Err(format!(
                "`--run {number}`: {file} has no such run; its runs are {there}"
            ));
        }
    }
    // The runs of a log are those of one boot.
    let bound_ns = runs.first().map_or(0, |run| bound::of(run, options));
    Ok(convert(&runs, bound_ns))
}
