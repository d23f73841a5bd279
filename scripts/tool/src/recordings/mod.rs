//! Shows a recording, and converts it to and from other formats: the subcommand `recording`.
//!
//! A recording is the file of a run's inputs, in the format defined by the crate `recording`. The
//! subcommand shows a recording as a table, whole or for a single job. It writes tables of
//! comma-separated values (`table`) or an MCAP file (`mcap`), and makes recordings from tables.

pub mod mcap;
mod table;

use std::env;
use std::ffi::OsString;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::Path;
use std::process::{self, ExitCode};

use recording::{
    Chunk, Commit, Counted, Entry, EntryKind, Recording, Role, Schema, Shown, Times, Writer,
};
use text::{quoted, visible};

use crate::files::{self, NamedFile};
use crate::options::{Command, CommandLine, OptionName, Refusal, ValueKind, options};
use crate::proof::{self, observed};
use crate::system;
use views::protocol::Transcript;
use views::record::Record;

/// The options for writing views of the commits and runs of a record.
const OF_RUNS: [OptionName; 2] = [name::WITNESS, name::OBSERVE];

/// The options and the help text of `recording`.
pub static RECORDING: Command = Command {
    invocation: "./scripts/recording",
    about: "Shows a recording, and converts it from and to other formats.",
    positional: Some((
        ValueKind::File("FILE"),
        "A recording; with --from-csv, a table to make one of.",
    )),
    options: OPTIONS,
    notes: "\
Without an option it says what is in the recording. docs/recordings.md explains all of it.

exit codes: 0 all is well; 1 an output cannot be written; 2 a refused command line, or a
file that is no whole and unaltered recording, or no such table
",
};

options! {
    /// Write a table of each channel into this folder, and one of what else happened.
    CSV: ValueKind::File("DIR");
    /// Write an MCAP file, with messages in JSON, for Foxglove and others.
    MCAP: ValueKind::File("FILE");
    /// Of a run that was kept (`./scripts/run --keep FILE`): write what proves the commit's
    /// bounds.
    WITNESS: ValueKind::File("FILE");
    /// Of such a run: write what calls took, as WCETs with a margin of 20 %.
    OBSERVE: ValueKind::File("FILE");
    /// Show all that is recorded of a job. (What its subtasks compute of it is shown by the
    /// app's own replay.)
    UNTIL: ValueKind::Text("DAG/JOB");
    /// Make a recording of a table whose rows are what a source returns.
    FROM_CSV: ValueKind::Nothing;
    /// --from-csv: write the recording to this file.
    OUT 'o': ValueKind::File("FILE");
    /// --from-csv: the DAG of the source.
    DAG: ValueKind::Text("NAME");
    /// --from-csv: the topic that it writes.
    TOPIC: ValueKind::Text("NAME");
    /// --from-csv: the type of the values, as `Seen { at: [f64; 3], name: text }`, its numbers
    /// in the order of the columns; else each column is a field of type f64.
    TYPE: ValueKind::Text("TYPE");
    /// --from-csv: columns that are no part of the values, with commas between.
    IGNORE: ValueKind::Text("COLUMNS");
    /// --from-csv: the time from job to job, such as 10ms; a column release_ns has to agree.
    PERIOD: ValueKind::Text("TIME");
}

/// Runs the subcommand with the words after its name.
pub fn recording(words: &[OsString]) -> ExitCode {
    RECORDING.carry_out(words, |options| {
        attempt(options).map(|()| ExitCode::SUCCESS)
    })
}

fn attempt(options: &CommandLine) -> Result<(), Refusal> {
    let question = "which file? name a recording, or with --from-csv a table";
    let input = options.file(question).map_err(Refusal::Usage)?;
    check(input, options).map_err(Refusal::Usage)?;
    let file = input.path;
    if options.is_given(name::FROM_CSV) {
        let bytes = table::convert(file, options).map_err(Refusal::Usage)?;
        let out = options.path(name::OUT).unwrap_or(Path::new(""));
        write(out, |out| out.write_all(&bytes))?;
        println!("{}: {} bytes", files::shown_path(out), bytes.len());
        return Ok(());
    }
    let bytes = read(file).map_err(Refusal::Usage)?;
    let recording = parse(file, &bytes).map_err(Refusal::Usage)?;
    // Before anything is printed, since this may refuse.
    of_runs(&recording, options).map_err(Refusal::Usage)?;
    let bytes = in_run_time(&recording);
    let rebased = parse(file, &bytes).map_err(Refusal::Usage)?;
    match options.text(name::UNTIL) {
        Some(job) => print!("{}", inputs_until(&rebased, job).map_err(Refusal::Usage)?),
        None => print!("{}", shown(&recording)),
    }
    if let Some(folder) = options.path(name::CSV) {
        for (name, table) in table::tables(&rebased) {
            let path = folder.join(name);
            write(&path, |out| out.write_all(table.as_bytes()))?;
            println!("{}", files::shown_path(&path));
        }
    }
    if let Some(path) = options.path(name::MCAP) {
        let mut messages = 0;
        write(path, |out| {
            messages = mcap::write(&rebased, out)?;
            Ok(())
        })?;
        println!("{}: {messages} messages", files::shown_path(path));
    }
    Ok(())
}

/// Returns the recording with all times in run time. Functions that ask for the time or get a
/// sample see the clock's time, so the epoch is subtracted from recorded times.
fn in_run_time(recording: &Recording<'_>) -> Vec<u8> {
    let texts = recording.chunks().filter_map(|chunk| match chunk {
        Chunk::Text(text) => Some(text),
        _ => None,
    });
    let said = Transcript::read(&texts.collect::<String>());
    let epoch = said.of_kind("epoch").next();
    let epoch_ns = epoch.and_then(|line| line.number_at("ns")).unwrap_or(0);
    let header = recording.header();
    let mut record = Writer::new(header);
    for entry in recording.entries() {
        let mut value = entry.value.to_vec();
        let role = header.channels.get(usize::from(entry.place));
        let times = match (entry.what, role.map(|channel| channel.role)) {
            // The times stand behind the length of the list, or behind `some` and the job.
            (EntryKind::Clock, _) => value.get_mut(4..),
            (EntryKind::Value, Some(Role::Sample)) => value.get_mut(9..17),
            _ => None,
        };
        for time in times.unwrap_or_default().as_chunks_mut().0 {
            let clock_ns = u64::from_le_bytes(*time);
            *time = clock_ns.saturating_sub(epoch_ns).to_le_bytes();
        }
        let value = &value;
        record.write(&Entry { value, ..entry });
    }
    record.end()
}

/// Writes the requested views of commits and runs.
fn of_runs(recording: &Recording<'_>, options: &CommandLine) -> Result<(), String> {
    let Some(name) = options.given_of(&OF_RUNS) else {
        return Ok(());
    };
    let record = Record::of(recording, String::new())?;
    // Recordings of values alone have no commit.
    if record.commits.is_empty() {
        let line = "it has values alone; `./scripts/run --keep FILE` keeps all of a run";
        return Err(format!("`--{name}`: {line}"));
    }
    if let Some(path) = options.path(name::WITNESS) {
        println!("{}", proof::write(path, record.proven()?)?);
    }
    if let Some(path) = options.path(name::OBSERVE) {
        let mut observed = Vec::new();
        observed::add(&mut observed, &record)?;
        let text = observed::text(&observed, observed::MARGIN_PERCENT);
        files::write_named(name::OBSERVE.as_str(), path, text)?;
        println!("{}", files::shown_path(path));
    }
    Ok(())
}

/// Checks the options and all files before opening any of them.
fn check(input: NamedFile<'_>, options: &CommandLine) -> Result<(), String> {
    let of_tables = [name::OUT, name::DAG, name::TOPIC];
    if options.is_given(name::FROM_CSV) {
        if let Some(name) = of_tables.into_iter().find(|name| !options.is_given(*name)) {
            return Err(format!("`--from-csv` needs `--{name}`; give it, too"));
        }
        let why = "and `--from-csv` exclude each other; convert what it has written";
        options.check_without(&[name::CSV, name::MCAP, name::UNTIL], why)?;
        options.check_without(&OF_RUNS, why)?;
    } else {
        let why = "needs `--from-csv`; give it, too";
        options.check_without(&of_tables, why)?;
        options.check_without(&[name::TYPE, name::IGNORE, name::PERIOD], why)?;
    }
    files::check(
        &[input],
        &options.named(&[name::OUT, name::MCAP, name::WITNESS, name::OBSERVE]),
    )?;
    (options.named(&[name::CSV]).iter()).try_for_each(files::check_folder)
}

/// Reads a file that must be a recording, and completes a truncated recording.
pub(crate) fn read(file: &Path) -> Result<Vec<u8>, String> {
    let place = files::shown_path(file);
    let bytes = files::read(file).map_err(|why| format!("{place}: {why}; name another file"))?;
    let bytes = recording::completed(bytes).map_err(|malformed| format!("{place}: {malformed}"))?;
    Ok(bytes.into_owned())
}

/// Reads the bytes sent by a guest to the debug port, without the output of a firmware, which
/// prints there before the guest.
///
/// # Errors
///
/// The file cannot be read.
pub fn received(file: &Path) -> std::io::Result<Vec<u8>> {
    let mut bytes = fs::read(file)?;
    let mut windows = bytes.windows(recording::MAGIC.len());
    let start = windows.position(|window| window == recording::MAGIC);
    // Without a beginning there is no recording, and all bytes are dropped.
    bytes.drain(..start.unwrap_or(bytes.len()));
    Ok(bytes)
}

/// Reads bytes as a recording.
pub(crate) fn parse<'b>(file: &Path, bytes: &'b [u8]) -> Result<Recording<'b>, String> {
    let place = files::shown_path(file);
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
    write().map_err(|error| format!("cannot write {}: {error}", files::shown_path(path)))
}

/// Returns a Python with PyPI's `mcap`, a reader of MCAP files independent of this module.
///
/// # Errors
///
/// In words: the Python has no such package.
pub fn independent_reader() -> Result<OsString, String> {
    let python = env::var_os("MCAP_PYTHON").unwrap_or("python3".into());
    match system::run(process::Command::new(&python).args(["-c", "import mcap"])) {
        Ok(_) => Ok(python),
        Err(_) => Err(format!(
            "{} has no package mcap; install it, or name a Python that has it by MCAP_PYTHON",
            files::shown_path(Path::new(&python))
        )),
    }
}

/// Returns a description of the recording for people.
#[allow(clippy::too_many_lines, reason = "a text, line by line")]
fn shown(recording: &Recording<'_>) -> String {
    let header = recording.header();
    let mut values = vec![0_u64; header.channels.len()];
    let mut others = [
        (EntryKind::Signal, 0),
        (EntryKind::Skip, 0),
        (EntryKind::Cut, 0),
        (EntryKind::Restart, 0),
        (EntryKind::Clock, 0),
        (EntryKind::Fault, 0),
    ];
    let mut span_ns: Option<(u64, u64)> = None;
    for entry in recording.entries() {
        let (first, last) = span_ns.unwrap_or((entry.release_ns, entry.at_ns));
        span_ns = Some((first.min(entry.release_ns), last.max(entry.at_ns)));
        match others.iter_mut().find(|(what, _)| *what == entry.what) {
            Some((_, count)) => *count += 1,
            None if entry.what == EntryKind::Value => values[usize::from(entry.place)] += 1,
            None => {}
        }
    }
    let mut text = String::new();
    // Writing into a `String` cannot fail.
    let (app, count) = (visible(&header.app), recording.count());
    let _ = writeln!(text, "recording of `{app}`, {count} entries");
    if let Some((first, last)) = span_ns {
        let _ = writeln!(text, "from {first} ns to {last} ns");
    }
    for (channel, values) in header.channels.iter().zip(values) {
        let dag = visible(&header.dags[usize::from(channel.dag)].name);
        let (role, topic) = (channel.role.name(), visible(&channel.topic));
        let schema = channel.schema.to_string();
        let schema = visible(&schema);
        let counted = format!("{values} values of {schema}");
        let _ = writeln!(text, "  {role} `{topic}` of dag `{dag}`: {counted}");
    }
    for (what, count) in others {
        if count > 0 {
            let _ = writeln!(text, "  {count} times {}", what.name());
        }
    }
    let (mut commits, mut events, mut runs, mut lines) = (Vec::new(), 0, 0, 0);
    let mut tables = String::new();
    for chunk in recording.chunks() {
        match chunk {
            Chunk::Header(_) | Chunk::Entry(_) => {}
            Chunk::Text(text) => lines += text.lines().count(),
            Chunk::Commit(commit) => commits.push(commit),
            Chunk::Events(some) => events += some.words().count(),
            Chunk::Times(times) => {
                let of_run = commits.last().map(|of| table(runs, of, &times));
                tables += &of_run.unwrap_or_default();
                runs += 1;
            }
        }
    }
    let counts = [
        (commits.len(), "commits"),
        (events, "events"),
        (runs, "runs that have ended"),
        (lines, "machine lines"),
    ];
    for (count, what) in counts {
        if count > 0 {
            let _ = writeln!(text, "  {count} {what}");
        }
    }
    for answer in commits.iter().flat_map(|commit| &commit.answers) {
        let _ = writeln!(text, "  {}", visible(answer));
    }
    let cut = "incomplete: it says nothing of what came after its last entry";
    let _ = match recording.lost() {
        _ if recording.is_cut() => writeln!(text, "{cut}"),
        0 => writeln!(text, "complete"),
        lost => writeln!(text, "incomplete: {lost} values are lost"),
    };
    text + &tables
}

/// Returns the times of all jobs of a run, including jobs with lost events.
fn table(run: usize, commit: &Commit, times: &Times) -> String {
    let mut text = String::new();
    let mut row = |name: &str, counted: &Counted| {
        let times = observed::distribution(counted);
        let figures = [times.min(), times.median(), times.p99(), times.max()];
        let figures = figures.map(|ns| format!("{:>12}", views::units::shown(ns)));
        let figures = figures.concat();
        // Writing into a `String` cannot fail. A row without samples would show zeros that nobody
        // has measured.
        let _ = match times.count() {
            0 => Ok(()),
            count => writeln!(text, "  {name:<34}{count:>8}{figures}"),
        };
    };
    for (dag, times) in commit.dags.iter().zip(&times.dags) {
        let name = visible(&dag.name).to_string();
        row(&format!("`{name}` response"), &times.response);
        row(&format!("`{name}` release jitter"), &times.release_jitter);
        for (subtask, times) in dag.subtasks.iter().zip(&times.subtasks) {
            let name = visible(&subtask.name).to_string();
            row(&format!("  `{name}` join to start"), &times.join_latency);
            row(&format!("  `{name}` execution"), &times.execution);
            if let Some((response, ..)) = &times.sink {
                row(&format!("  `{name}` response"), response);
            }
        }
    }
    let columns = "count         min      median         p99         max";
    match text.is_empty() {
        true => text,
        false => format!("run {run}{columns:>87}\n{text}"),
    }
}

/// Returns the lines about the job given as `DAG/JOB`.
fn inputs_until(recording: &Recording<'_>, job: &str) -> Result<String, String> {
    let header = recording.header();
    // The last `/`, since a DAG's name may contain one.
    let parts = job.rsplit_once('/');
    let parts = parts.and_then(|(dag, number)| Some((dag, number.parse::<u64>().ok()?)));
    let Some((name, number)) = parts else {
        let wanted = "DAG/JOB is wanted, such as gait/17";
        return Err(format!("`--until {}`: {wanted}", visible(job)));
    };
    let Some(dag) = header.dags.iter().position(|dag| dag.name == name) else {
        let there = header.dags.iter().map(|dag| quoted(&dag.name).to_string());
        let there = there.collect::<Vec<String>>().join(", ");
        let why = format!("there is no dag {}", quoted(name));
        return Err(format!("`--until`: {why}; there are {there}"));
    };
    let is_its = |entry: &Entry<'_>| usize::from(entry.dag) == dag && entry.job == number;
    let mut of_job = recording.entries().filter(is_its).peekable();
    let Some(first) = of_job.peek() else {
        let why = "nothing is recorded of";
        return Err(format!("`--until`: {why} job {number} of that dag"));
    };
    let mut text = String::new();
    // Writing into a `String` cannot fail.
    let (name, due_ns) = (visible(name), first.release_ns);
    let _ = writeln!(text, "job {number} of dag `{name}`, due at {due_ns} ns");
    let times = Schema::parse("[u64]").expect("it is a schema");
    for entry in of_job {
        let (at_ns, place, bytes) = (entry.at_ns, entry.place, entry.value);
        let what = entry.what;
        let told = match (what, header.channels.get(usize::from(place))) {
            (EntryKind::Value | EntryKind::Lost, Some(channel)) => {
                let (schema, topic) = (&channel.schema, visible(&channel.topic));
                let (subtask, role) = (channel.subtask, channel.role.name());
                let shown = match what {
                    EntryKind::Lost => "lost".to_string(),
                    _ => Shown { schema, bytes }.to_string(),
                };
                format!(", subtask {subtask}, {role} `{topic}`: {shown}")
            }
            (EntryKind::Clock, _) => {
                let schema = &times;
                let shown = Shown { schema, bytes };
                format!(", subtask {place}, told the time: {shown}")
            }
            (EntryKind::Cut | EntryKind::Restart | EntryKind::Fault, _) => {
                format!(", subtask {place}: {}", what.name())
            }
            _ => format!(": {}", what.name()),
        };
        let _ = writeln!(text, "  {at_ns} ns{told}");
    }
    Ok(text)
}
