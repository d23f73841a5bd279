//! Checks traces: judges the events of a run by the model's rules.
//!
//! This module has two subcommands. `check-trace` prints the [`views::findings`] of runs and the
//! times of their [chains]; `trace` draws a run instead of judging it. Both read all files before
//! handling the first run, so a damaged file does not hide behind the breaches of another.

mod certified;
mod drawn;
mod perfetto;

use std::ffi::OsString;
use std::fmt::Write;
use std::path::Path;
use std::process::ExitCode;

use sched_dag::chains::{Chain, SubtaskRef};
use sched_dag::{DagId, Preemption};
use views::chains::{self, MeasuredChain};
use views::findings::{Findings, check, distribution, object};
use views::json::{Object, quoted};
use views::links;
use views::record::{Record, Run, tolerance_ns};
use views::units::shown as shown_ns;
use views::view::View;

use crate::files;
use crate::options::{Command, CommandLine, Refusal, ValueKind, did_you_mean, options};

pub use drawn::{TRACE, trace};

/// Reads the runs of the record in a log.
///
/// # Errors
///
/// In words: the fault of the record.
pub fn read(log: &str) -> Result<Vec<Run>, String> {
    Record::of_log(log).map(|record| record.runs)
}

/// The options and the help text of `check-trace`.
pub static CHECK_TRACE: Command = Command {
    invocation: "./scripts/check-trace",
    about: "Replays the traces of runs against the model's rules and reports each breach.",
    positional: Some((
        ValueKind::File("FILE..."),
        "Records of runs, as `./scripts/run --trace FILE` and --keep write them, or serial logs.",
    )),
    options: OPTIONS,
    notes: "\
rules:
  R1 release              nothing of a job before O + kT
  R2 join                 after all predecessors and the subtask's own job before
  R3 completion boundary  all that waits for a finish is released in its step
  R4 completion           complete with the last finish; missed if that is late
  R5 dispatch             the smallest keys run; no core idles while one waits
  one life                an instance starts and finishes once, on one core at a time
  one core                a core runs one instance at a time

A run with bounds is *certified* if it is recorded from begin to end, no rule is broken, no
subtask that keeps its core began out of order, no job with a bound was cut, no WCET is
exceeded, and no more time is lost than WCETs and charges leave; so each bound held.
Else the first condition that fails is told, which is no breach (docs/proving.md).

chains: from a source to a sink, from DAG to DAG by samples of latest values
  age of an output        from the release that it goes back to, to its finish
  data age                the same, to the finish of the next output
  reaction time           from what a release just misses to the first output of it

Records of several machines whose messages have hops (docs/ros.md) are read as one: chains
lead over their links, with the delay that the app states, which nothing proves.

For each run there is a machine line of kind `trace_check`, one of kind `chain` for each
chain and one of kind `link` for each link; docs/formats.md explains them.

exit codes: 0 no breach; 1 some; 2 a refused command line, or a file without a
well-formed trace with events
",
};

options! {
    /// Microseconds for which an instance may wait for what it is owed, because a decision
    /// takes effect after an interrupt; 50 in mode deterministic, on Linux 5000 by fifo, 10000
    /// by sched_ext, 100000 where nothing is preempted, else 1000.
    BOUND_US: ValueKind::Number(0, 1_000_000_000);
    /// Only the chains that begin with this subtask; with --to.
    FROM: ValueKind::Text("DAG/SUBTASK");
    /// Only the chains that end with this subtask; with --from.
    TO: ValueKind::Text("DAG/SUBTASK");
    /// Check the witness of a certified run, and name the theorems of its bounds; needs Coq.
    PROVEN: ValueKind::Nothing;
    /// Only the machine lines on standard output, the rest on standard error.
    JSON: ValueKind::Nothing;
}

/// Runs the subcommand with the words after its name.
pub fn check_trace(words: &[OsString]) -> ExitCode {
    CHECK_TRACE.carry_out(words, |options| {
        let breaches = judge_all(options).map_err(Refusal::Usage)?;
        Ok(ExitCode::from(u8::from(breaches > 0)))
    })
}

/// Judges the runs of all files, and returns the number of breaches.
fn judge_all(options: &CommandLine) -> Result<usize, String> {
    if options.files().len() == 0 {
        return Err("which files? name at least one record of a run".into());
    }
    files::check_once(options.files())?;
    let records = read_files(options)?;
    let files: Vec<&str> = records.iter().map(|(file, _)| &file[..]).collect();
    let (files, joint) = (files.join(" "), links::join(&records));
    let runs = records.into_iter().flat_map(|(file, record)| {
        let runs = record.runs.into_iter();
        runs.map(move |run| (file.clone(), run))
    });
    let mut runs: Vec<(String, Run)> = runs.collect();
    let is_joint = matches!(joint, Ok(Some(_)));
    match joint {
        Ok(joint) => runs.extend(joint.map(|run| (files, run))),
        Err(why) => eprintln!("{files}: each is read alone, as {why}"),
    }
    // All chains are measured first, to report a wrong name before any output.
    let measured = runs.iter().map(|(_, run)| match run.machines[..] {
        [] if is_joint => Ok(Vec::new()),
        _ => measure(run, options),
    });
    let measured: Vec<_> = measured.collect::<Result<_, _>>()?;
    let judged = runs.iter().zip(&measured);
    let breaches = judged.map(|((file, run), chains)| judge(file, run, chains, options));
    Ok(breaches.sum())
}

/// Reads all files.
fn read_files(options: &CommandLine) -> Result<Vec<(String, Record)>, String> {
    let read = |path| Ok((files::shown_path(path), read_file(path)?));
    options.files().map(read).collect()
}

/// Reads a file's runs; at least one of them must have events.
pub(crate) fn read_file(path: &Path) -> Result<Record, String> {
    let file = files::shown_path(path);
    let bytes = files::read(path).map_err(|why| format!("{file}: {why}; name another file"))?;
    let record = Record::read(&bytes).map_err(|why| format!("{file}: {why}"))?;
    match &record.runs[..] {
        [] => Err(format!(
            "{file}: there is no run in it; `./scripts/run --trace FILE` keeps one"
        )),
        runs if runs.iter().all(|run| run.events.is_empty()) => {
            Err(format!("{file}: no run of the file has an event"))
        }
        _ => Ok(record),
    }
}

/// Judges a run, prints the findings, and returns the number of breaches.
fn judge(file: &str, run: &Run, chains: &[MeasuredChain], options: &CommandLine) -> usize {
    let bound_ns = tolerance_ns(run, options.number(name::BOUND_US));
    let (mut table, lines, breaches) = match &run.machines[..] {
        [] => {
            let findings = check(run, bound_ns);
            let (words, failed) = certified::told(run, &findings, options.is_given(name::PROVEN));
            let table = table(file, run, &findings, bound_ns) + &words;
            let line = machine_line(file, run, &findings, failed);
            // A bound exceeded although all conditions hold is a breach, too.
            let breaches = findings.breaches.len() + usize::from(failed == "bound");
            (table, vec![line], breaches)
        }
        _ => {
            let (table, lines) = links::told(file, run);
            (table, lines, 0)
        }
    };
    table += &chain_table(run, chains, options.is_given(name::FROM));
    let exceeded: usize = chains.iter().map(|chain| chain.exceeded(bound_ns)).sum();
    if exceeded > 0 {
        let what = "times of chains are beyond their bounds";
        let _ = writeln!(table, "  breach {exceeded} {what}");
    }
    match options.is_given(name::JSON) {
        true => eprint!("{table}"),
        false => print!("{table}"),
    }
    lines.iter().for_each(|line| println!("{line}"));
    for chain in chains {
        println!("{}", chain_line(file, run, chain, bound_ns));
    }
    breaches + exceeded
}

/// The most breaches shown for a run; all are counted.
const MOST: usize = 20;

/// Returns the text for people: the first breaches, then the figures.
pub fn table(file: &str, run: &Run, findings: &Findings, bound_ns: u64) -> String {
    let mut text = String::new();
    let Findings { breaches, figures } = findings;
    let policy = run.options.policy.word();
    let preemption = match run.options.preemption {
        Preemption::Enabled => "on",
        Preemption::Disabled => "off",
    };
    let (number, cores) = (run.number, run.options.cores);
    let mut say = |line: &str| {
        // Writing into a `String` cannot fail.
        let _ = writeln!(text, "{line}");
    };
    say(&format!(
        "{file}: run {number}, policy {policy}, preemption {preemption}, {cores} cores"
    ));
    for breach in breaches.iter().take(MOST) {
        say(&format!("  breach {}", breach.with_names(&run.task_set)));
    }
    if breaches.len() > MOST {
        say(&format!("  and {} breaches more", breaches.len() - MOST));
    }
    if run.lost > 0 {
        say(&format!(
            "  {} events were lost: only what came from {} ns on is judged",
            run.lost, figures.from_ns
        ));
    }
    if !run.complete {
        say("  the record ends before the run: only what came until then is judged");
    }
    let mut row = |name: &str, value: &str| say(&format!("  {name:32}{value}"));
    row("events", &figures.events.to_string());
    row("instances started", &figures.instances.to_string());
    row("preemptions", &figures.preemptions.to_string());
    let largest = shown_ns(figures.finish_to_ready_max_ns);
    row("finish to ready, largest", &largest);
    let to_start = distribution(&figures.ready_to_start);
    row("ready to start, a core idle", &to_start);
    row("preemption latency", &distribution(&figures.preemption));
    let [longest, bound] = [figures.longest_inversion_ns, bound_ns].map(shown_ns);
    row("longest inversion", &format!("{longest} (bound {bound})"));
    let loads = figures.load_permille.iter();
    let loads = loads.map(|load| format!("{}.{} %", load / 10, load % 10));
    let loads: Vec<String> = loads.collect();
    row("load by core", &loads.join("  "));
    row("breaches", &breaches.len().to_string());
    text
}

/// Returns the machine line of kind `trace_check`.
pub fn machine_line(file: &str, run: &Run, findings: &Findings, failed_condition: &str) -> String {
    let Findings { breaches, figures } = findings;
    Object::new()
        .text("kind", "trace_check")
        .text("file", file)
        .number("run", run.number)
        .number("events", figures.events as u64)
        .number("lost", run.lost)
        .number("judged_from_ns", figures.from_ns)
        .number("span_ns", figures.span_ns)
        .number("instances", figures.instances as u64)
        .number("preemptions", figures.preemptions)
        .number("breaches", breaches.len() as u64)
        .number("finish_to_ready_max_ns", figures.finish_to_ready_max_ns)
        .json("ready_to_start_ns", &object(&figures.ready_to_start))
        .json("preemption_latency_ns", &object(&figures.preemption))
        .number("longest_inversion_ns", figures.longest_inversion_ns)
        .list("load_permille", &figures.load_permille)
        .text("failed_condition", failed_condition)
        .into_text()
}

/// The most chains shown for a run, unless the options name a chain.
const SHOWN: usize = 8;

/// Measures the chains named by the options, or else all chains.
///
/// # Errors
///
/// In words: there is no such subtask, or no chain between the two subtasks.
fn measure(run: &Run, options: &CommandLine) -> Result<Vec<MeasuredChain>, String> {
    let ends = match (options.text(name::FROM), options.text(name::TO)) {
        (None, None) => None,
        (Some(from), Some(to)) => {
            let from = named_subtask(run, "from", from)?;
            Some((from, named_subtask(run, "to", to)?))
        }
        _ => return Err("give both `--from` and `--to`, or neither for all chains".into()),
    };
    let found = chains::of(run, ends);
    if ends.is_some() && found.is_empty() {
        let ends = [name::FROM, name::TO].map(|end| options.text(end).unwrap_or_default());
        let (number, [from, to]) = (run.number, ends);
        return Err(format!(
            "run {number}: no edges and samples lead from `{from}` to `{to}`; `./scripts/page FILE` \
             draws which there are"
        ));
    }
    Ok(chains::measured(&View::new(run), &found))
}

/// Finds the subtask named by an option.
fn named_subtask(run: &Run, option: &str, name: &str) -> Result<SubtaskRef, String> {
    Chain::find(&run.task_set, name).ok_or_else(|| {
        let dags = (0..).map(DagId).zip(run.task_set.dags());
        let all: Vec<String> = dags
            .flat_map(|(dag, model)| {
                let of_dag = match model.name() {
                    "" => dag.0.to_string(),
                    name => name.to_string(),
                };
                let subtasks = model.subtasks().iter();
                subtasks.map(move |subtask| format!("{of_dag}/{}", subtask.name()))
            })
            .collect();
        let names: Vec<&str> = all.iter().map(String::as_str).collect();
        let (number, hint) = (run.number, did_you_mean(name, &names));
        format!("`--{option} {name}`: run {number} has no such subtask{hint}")
    })
}

/// Returns the lines about chains for people.
fn chain_table(run: &Run, chains: &[MeasuredChain], is_named: bool) -> String {
    let mut text = String::new();
    let shown = if is_named { chains.len() } else { SHOWN };
    for chain in chains.iter().take(shown) {
        // Writing into a `String` cannot fail.
        let _ = writeln!(text, "  chain {}", chain.names.join(" > "));
        let names = ["age of an output", "data age", "reaction time"];
        for (name, (times, bound)) in names.into_iter().zip(&chain.times) {
            let bound = match (bound, chain.stated_ns) {
                (Ok(ns), None) => format!("bound {}", shown_ns(*ns)),
                (Ok(ns), Some(stated_ns)) => format!(
                    "bound {}, of which {} is the stated delay of links, which nothing proves",
                    shown_ns(*ns),
                    shown_ns(stated_ns)
                ),
                (Err(_), Some(_)) => "no bound over links".into(),
                (Err(dag), None) => match run.task_set.dag(*dag) {
                    model if model.is_sporadic() => {
                        format!("no bound, as dag `{}` is sporadic", model.name())
                    }
                    model => format!("no bound, as dag `{}` has none", model.name()),
                },
            };
            let _ = writeln!(text, "    {name:30}{} ({bound})", distribution(times));
        }
    }
    if chains.len() > shown {
        let more = chains.len() - shown;
        let how = "`--from DAG/SUBTASK --to DAG/SUBTASK` shows those between two subtasks";
        let _ = writeln!(text, "  and {more} chains more; {how}");
    }
    text
}

/// Returns the machine line of kind `chain`.
fn chain_line(file: &str, run: &Run, chain: &MeasuredChain, tolerance_ns: u64) -> String {
    let bound = |of: &Result<u64, DagId>| of.map_or("null".into(), |ns| ns.to_string());
    let [output_age, data_age, reaction] = &chain.times;
    let line = Object::new()
        .text("kind", "chain")
        .text("file", file)
        .number("run", run.number)
        .list("path", chain.names.iter().map(|name| quoted(name)))
        .json("output_age_ns", &object(&output_age.0))
        .json("data_age_ns", &object(&data_age.0))
        .json("reaction_ns", &object(&reaction.0))
        .json("output_age_bound_ns", &bound(&output_age.1))
        .json("reaction_bound_ns", &bound(&reaction.1))
        .number("exceeded", chain.exceeded(tolerance_ns) as u64);
    let stated = |line: Object, ns: u64| line.number("stated_ns", ns);
    chain.stated_ns.into_iter().fold(line, stated).into_text()
}
