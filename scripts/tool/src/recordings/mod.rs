//! The subcommand `recording`: what is in a recording, and other formats of it.
//!
//! A recording is the file of what entered a run; the crate `recording` has its format. It is
//! shown as a table, written as tables of comma-separated values (`table_out`) and as an MCAP
//! file (`mcap`), and made of a table (`table_in`).

pub mod mcap;
mod mcap_json;
mod summary;
mod table_in;
mod table_out;
mod until;

use std::env;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::Path;
use std::process::{self, ExitCode};

use recording::Recording;

use crate::dot;
use crate::files::{self, Named};
use crate::options::{Command, Parsed, Refusal, Takes, options};
use crate::proof::{observed, wcets, witness};
use crate::record::Record;

/// The options that want something of the runs of a record.
const OF_RUNS: [&str; 3] = ["dot", "witness", "observe"];

/// The table of `recording`.
pub static RECORDING: Command = Command {
    invocation: "./scripts/recording",
    about: "Shows a recording, and converts it from and to other formats.",
    positional: Some((
        Takes::File("FILE"),
        "A recording; with --from-csv, a table to make one of.",
    )),
    options: options! {
        /// Write a table of each channel into this folder, and one of what else happened.
        "csv": Takes::File("DIR");
        /// Write an MCAP file, with messages in JSON, for Foxglove and others.
        "mcap": Takes::File("FILE");
        /// Of a run that was kept (`./scripts/run --keep FILE`): write the committed DAGs to this
        /// file, for Graphviz.
        "dot": Takes::File("FILE");
        /// Of such a run: write what proves the commit's bounds.
        "witness": Takes::File("FILE");
        /// Of such a run: write what calls took, as WCETs with a margin of 20 %.
        "observe": Takes::File("FILE");
        /// Show all that is recorded of a job. (What its subtasks compute of it is shown by the
        /// app's own replay.)
        "until": Takes::Text("DAG/JOB");
        /// Make a recording of a table whose rows are what a source returns.
        "from-csv": Takes::Nothing;
        /// --from-csv: write the recording to this file.
        "out" 'o': Takes::File("FILE");
        /// --from-csv: the DAG of the source.
        "dag": Takes::Text("NAME");
        /// --from-csv: the topic that it writes.
        "topic": Takes::Text("NAME");
        /// --from-csv: the type of the values, as `Seen { at: [f64; 3], name: text }`, its numbers
        /// in the order of the columns; else each column is a field of type f64.
        "type": Takes::Text("TYPE");
        /// --from-csv: columns that are no part of the values, with commas between.
        "ignore": Takes::Text("COLUMNS");
        /// --from-csv: the time from row to row, such as 10ms, if there is no column release_ns.
        "period": Takes::Text("TIME");
    },
    notes: "\
Without an option it says what is in the recording. docs/recordings.md explains all of it.

exit codes: 0 all is well; 1 an output cannot be written; 2 a refused command line, or a
file that is no whole and unaltered recording, or no such table
",
};

/// Runs the subcommand with the words after its name.
#[must_use]
pub fn recording(words: &[OsString]) -> ExitCode {
    RECORDING.carry_out(words, |options| {
        attempt(options).map(|()| ExitCode::SUCCESS)
    })
}

fn attempt(options: &Parsed) -> Result<(), Refusal> {
    let question = "which file? name a recording, or with --from-csv a table";
    let input = options.file(question).map_err(Refusal::Usage)?;
    check(input, options).map_err(Refusal::Usage)?;
    let file = input.path;
    if options.is_given("from-csv") {
        let bytes = table_in::convert(file, options).map_err(Refusal::Usage)?;
        let out = options.path("out").unwrap_or(Path::new(""));
        write(out, |out| out.write_all(&bytes))?;
        println!("{}: {} bytes", files::place(out), bytes.len());
        return Ok(());
    }
    let bytes = read(file).map_err(Refusal::Usage)?;
    let recording = parse(file, &bytes).map_err(Refusal::Usage)?;
    of_runs(&recording, options).map_err(Refusal::Usage)?;
    match options.text("until") {
        Some(job) => print!("{}", until::of(&recording, job).map_err(Refusal::Usage)?),
        None => print!("{}", summary::of(&recording)),
    }
    if let Some(folder) = options.path("csv") {
        for (name, table) in table_out::tables(&recording) {
            let path = folder.join(name);
            write(&path, |out| out.write_all(table.as_bytes()))?;
            println!("{}", files::place(&path));
        }
    }
    if let Some(path) = options.path("mcap") {
        let mut messages = 0;
        write(path, |out| {
            messages = mcap::write(&recording, out)?;
            Ok(())
        })?;
        println!("{}: {messages} messages", files::place(path));
    }
    Ok(())
}

/// Writes what the options want of the commits and runs of a record.
fn of_runs(recording: &Recording<'_>, options: &Parsed) -> Result<(), String> {
    let Some(name) = options.given_of(&OF_RUNS) else {
        return Ok(());
    };
    let record = Record::of(recording, String::new())?;
    if record.commits.is_empty() {
        let line = "it has values alone; `./scripts/run --keep FILE` keeps all of a run";
        return Err(format!("`--{name}`: {line}"));
    }
    if let Some(path) = options.path("dot") {
        files::write_named("dot", path, dot::text(&record)?)?;
        println!("{}", files::place(path));
    }
    if let Some(path) = options.path("witness") {
        println!("{}", witness::write(path, record.proven()?)?);
    }
    if let Some(path) = options.path("observe") {
        let mut observed = Vec::new();
        observed::add(&mut observed, &record)?;
        let text = wcets::text(&observed, wcets::MARGIN_PERCENT);
        files::write_named("observe", path, text)?;
        println!("{}", files::place(path));
    }
    Ok(())
}

/// Makes sure of the options and of all files, before any is opened.
fn check(input: Named<'_>, options: &Parsed) -> Result<(), String> {
    let of_tables = ["out", "dag", "topic"];
    if options.is_given("from-csv") {
        if let Some(name) = of_tables.into_iter().find(|name| !options.is_given(name)) {
            return Err(format!("`--from-csv` needs `--{name}`; give it, too"));
        }
        let views = options.given_of(&["csv", "mcap", "until"]);
        if let Some(name) = views.or(options.given_of(&OF_RUNS)) {
            let line = "`--from-csv` exclude each other; convert what it has written";
            return Err(format!("`--{name}` and {line}"));
        }
    } else if let Some(name) = options
        .given_of(&of_tables)
        .or(options.given_of(&["type", "ignore", "period"]))
    {
        return Err(format!("`--{name}` needs `--from-csv`; give it, too"));
    }
    files::check(
        &[input],
        &options.named(&["out", "mcap", "dot", "witness", "observe"]),
    )?;
    (options.named(&["csv"]).iter()).try_for_each(files::check_folder)
}

/// Reads a file that should be a recording.
pub(crate) fn read(file: &Path) -> Result<Vec<u8>, String> {
    files::read(file).map_err(|why| format!("{}: {why}; name another file", files::place(file)))
}

/// Reads what a guest has sent to the debug port. Firmware says what it does there, before.
///
/// # Errors
///
/// The file cannot be read.
pub fn received(file: &Path) -> std::io::Result<Vec<u8>> {
    let mut bytes = fs::read(file)?;
    let mut windows = bytes.windows(recording::MAGIC.len());
    let start = windows.position(|window| window == recording::MAGIC);
    bytes.drain(..start.unwrap_or(bytes.len()));
    Ok(bytes)
}

/// Takes what was read for a recording.
pub(crate) fn parse<'b>(file: &Path, bytes: &'b [u8]) -> Result<Recording<'b>, String> {
    let place = files::place(file);
    Recording::read(bytes).map_err(|malformed| format!("{place}: {malformed}"))
}

fn write(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
) -> Result<(), String> {
    let write = || {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder)?;
        }
        let mut out = BufWriter::new(File::create(path)?);
        fill(&mut out)?;
        out.flush()
    };
    write().map_err(|error| format!("cannot write {}: {error}", files::place(path)))
}

/// Returns a Python that has PyPI's `mcap`, which reads such files independently of us.
///
/// # Errors
///
/// In words: it has not.
pub fn independent_reader() -> Result<OsString, String> {
    let python = env::var_os("MCAP_PYTHON").unwrap_or("python3".into());
    let tried = process::Command::new(&python)
        .args(["-c", "import mcap"])
        .output();
    match tried.is_ok_and(|output| output.status.success()) {
        true => Ok(python),
        false => Err(format!(
            "{} has no package mcap; install it, or name a Python that has it by MCAP_PYTHON",
            files::place(Path::new(&python))
        )),
    }
}
