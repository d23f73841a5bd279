//! The trace checker: the events of a run, judged by the model's rules.
//!
//! A [record](crate::record) has the model of a run and its journal: a [`Run`]. The judge is
//! [`sched_dag::law`], which judges all runs, within a stated *bound*, because a decision takes
//! effect after an interrupt.
//!
//! This module has the subcommand `check-trace`; the [`RunFigures`], computed from a `View`, which
//! puts a run in the order of time; the latencies of effects from DAG to DAG
//! ([`sched_dag::chains`]); and [`viewer`], which draws a run instead of judging it. All files are
//! read before the first run is judged, so that a damaged one does not hide behind the breaches of
//! another.
//!
//! Lost events are always the oldest, and only events after the instant of the first one that is
//! left are judged. An instance that has not finished when the trace ends breaks no rule, unless
//! the run says that it is complete.
//!
//! The figures of a trace:
//!
//! - *finish to ready*: from the last finish that an instance waited for to its readiness; the
//!   largest.
//! - *ready to start*: from readiness to the function's call, of instances for
//!   which a core was idle when they became ready, unless another instance with
//!   a smaller key became ready meanwhile and took it.
//! - *preemption latency*: from the scheduler's request that a core run an
//!   instance to that instance's start or resumption there. A request that is
//!   overtaken, by another one for the core or because the instance runs
//!   elsewhere, does not count.
//! - *longest inversion*: the longest time for which an instance that should
//!   have run by R5 waited while one of lower priority ran or a core was idle.
//! - *load*: the part of the time from the first event to the last for which a
//!   core had an instance, in thousandths.
//!
//! A trace is *complete from* the first instant after the first event that is left; earlier events
//! are left out.

mod links;
pub mod picture;
pub mod viewer;

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fmt::Write;
use std::path::Path;
use std::process::ExitCode;

use sched_dag::chains::{Chain, SubtaskRef};
use sched_dag::journal::{Event, EventKind};
use sched_dag::law::sweep::WaitCounts;
use sched_dag::law::{self, Distribution, Violation};
use sched_dag::{CoreId, DagId, Instance, Preemption};

use crate::files;
use crate::json::{Object, quoted};
use crate::options::{Command, Parsed, Refusal, Takes, did_you_mean, options};
use crate::output::shown as shown_ns;
use crate::record::{Record, Run, tolerance_ns};

pub use viewer::TRACE;
pub use viewer::trace;

/// The findings in a run's trace.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Findings {
    /// The breaches by time.
    pub breaches: Vec<Violation>,
    /// The figures.
    pub figures: RunFigures,
}

/// Reads the runs of the record in a log.
///
/// # Errors
///
/// In words: the fault of the record.
pub fn read(log: &str) -> Result<Vec<Run>, String> {
    Record::of_log(log).map(|record| record.runs)
}

/// Judges a run. `bound_ns` is the longest time for which an instance may wait for a core that it
/// is owed; 0 is for virtual time.
pub fn check(run: &Run, bound_ns: u64) -> Findings {
    let (view, terms) = (View::new(run), run.terms(bound_ns));
    let verdict = law::judge(&run.task_set, terms, view.in_the_order_of_the_log());
    let by_time = view.events.iter().copied();
    let dispatch = law::judge_dispatch(&run.task_set, &run.options, terms, by_time);
    let mut breaches = verdict.violations;
    breaches.extend(dispatch.violations);
    // Two judges have reported; people read one list by time.
    breaches.sort_by_key(|breach| (breach.time_ns(), breach.rule()));
    Findings {
        breaches,
        figures: compute(&view, verdict.finish_to_ready_max_ns, dispatch.waits),
    }
}

/// The table of `check-trace`.
pub static CHECK_TRACE: Command = Command {
    invocation: "./scripts/check-trace",
    about: "Replays the traces of runs against the model's rules and reports each breach.",
    positional: Some((
        Takes::File("FILE..."),
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
    BOUND_US: Takes::Number(0, 1_000_000_000);
    /// Only the chains that begin with this subtask; with --to.
    FROM: Takes::Text("DAG/SUBTASK");
    /// Only the chains that end with this subtask; with --from.
    TO: Takes::Text("DAG/SUBTASK");
    /// Only the machine lines on standard output, the rest on standard error.
    JSON: Takes::Nothing;
}

/// Runs the subcommand with the words after its name.
pub fn check_trace(words: &[OsString]) -> ExitCode {
    CHECK_TRACE.carry_out(words, |options| {
        let breaches = judge_all(options).map_err(Refusal::Usage)?;
        Ok(ExitCode::from(u8::from(breaches > 0)))
    })
}

/// Judges the runs of all files, and returns the number of breaches.
fn judge_all(options: &Parsed) -> Result<usize, String> {
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
    // All chains are measured first, so that a wrong name is reported before any output.
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
fn read_files(options: &Parsed) -> Result<Vec<(String, Record)>, String> {
    let read = |path| Ok((files::shown_path(path), read_file(path)?));
    options.files().map(read).collect()
}

/// Reads a file's runs, of which at least one must have events.
fn read_file(path: &Path) -> Result<Record, String> {
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
fn judge(file: &str, run: &Run, chains: &[MeasuredChain], options: &Parsed) -> usize {
    let bound_ns = tolerance_ns(run, options.number(name::BOUND_US));
    let (mut table, lines, breaches) = match &run.machines[..] {
        [] => {
            let findings = check(run, bound_ns);
            let table = table(file, run, &findings, bound_ns);
            let line = machine_line(file, run, &findings);
            (table, vec![line], findings.breaches.len())
        }
        _ => {
            let (table, lines) = links::told(file, run);
            (table, lines, 0)
        }
    };
    table += &chain_table(run, chains, options.is_given(name::FROM));
    let exceeded: usize = chains.iter().map(|chain| chain.exceeded(bound_ns)).sum();
    if exceeded > 0 {
        let _ = writeln!(
            table,
            "  breach {exceeded} times of chains are beyond their bounds"
        );
    }
    if options.is_given(name::JSON) {
        eprint!("{table}");
    } else {
        print!("{table}");
    }
    lines.iter().for_each(|line| println!("{line}"));
    for chain in chains {
        println!("{}", chain_line(file, run, chain, bound_ns));
    }
    breaches + exceeded
}

/// The most breaches of a run that are shown; all are counted.
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
    row(
        "finish to ready, largest",
        &shown_ns(figures.finish_to_ready_max_ns),
    );
    row(
        "ready to start, a core idle",
        &distribution(&figures.ready_to_start),
    );
    row("preemption latency", &distribution(&figures.preemption));
    row(
        "longest inversion",
        &format!(
            "{} (bound {})",
            shown_ns(figures.longest_inversion_ns),
            shown_ns(bound_ns)
        ),
    );
    let loads = figures.load_permille.iter();
    let loads: Vec<String> = loads
        .map(|load| format!("{}.{} %", load / 10, load % 10))
        .collect();
    row("load by core", &loads.join("  "));
    row("breaches", &breaches.len().to_string());
    text
}

/// Returns the machine line of kind `trace_check`.
pub fn machine_line(file: &str, run: &Run, findings: &Findings) -> String {
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
        .into_text()
}

fn distribution(of: &Distribution) -> String {
    if of.count() == 0 {
        return "none".into();
    }
    format!(
        "median {}, p99 {}, max {} of {}",
        shown_ns(of.median()),
        shown_ns(of.p99()),
        shown_ns(of.max()),
        of.count()
    )
}

fn object(of: &Distribution) -> String {
    format!(
        "{{\"count\":{},\"median\":{},\"p99\":{},\"max\":{}}}",
        of.count(),
        of.median(),
        of.p99(),
        of.max()
    )
}

/// The largest number of chains shown for a run, unless one is named.
const SHOWN: usize = 8;

/// The times of a chain in a run, and their bounds.
struct MeasuredChain {
    names: Vec<String>,
    /// The age of an output, the data age and the reaction time.
    times: [(Distribution, Result<u64, DagId>); 3],
    /// The longest of each for which a bound holds, by clocks that may be wrong.
    longest_ns: [u64; 3],
    /// The stated delay of the links that it leads over, if any.
    stated_ns: Option<u64>,
}

impl MeasuredChain {
    /// Returns how many of its times are beyond their bounds, by more than the tolerance.
    fn exceeded(&self, tolerance_ns: u64) -> usize {
        let is_beyond = |(longest_ns, (_, bound)): &(&u64, &(_, Result<u64, DagId>))| {
            bound.is_ok_and(|ns| **longest_ns > ns.saturating_add(tolerance_ns))
        };
        let times = self.longest_ns.iter().zip(&self.times);
        times.filter(is_beyond).count()
    }
}

/// Measures the chains that the options name, or else all.
///
/// # Errors
///
/// In words: there is no such subtask, or no chain between the two.
fn measure(run: &Run, options: &Parsed) -> Result<Vec<MeasuredChain>, String> {
    let links = run.links.iter().map(|link| link.edge);
    let samplings = &run
        .samplings
        .iter()
        .copied()
        .chain(links)
        .collect::<Vec<_>>();
    let ends = (options.text(name::FROM), options.text(name::TO));
    let chains = match ends {
        (None, None) => Chain::all(&run.task_set, samplings),
        (Some(from), Some(to)) => {
            let ends = (
                named_subtask(run, "from", from)?,
                named_subtask(run, "to", to)?,
            );
            let chains = Chain::between(&run.task_set, samplings, ends.0, ends.1);
            if chains.is_empty() {
                return Err(format!(
                    "run {}: no edges and samples lead from `{from}` to `{to}`; \
                     `./scripts/run --dot FILE` draws which there are",
                    run.number
                ));
            }
            chains
        }
        _ => return Err("give both `--from` and `--to`, or neither for all chains".into()),
    };
    let view = View::new(run);
    let events: Vec<_> = view.in_the_order_of_the_log().collect();
    let sampled = [true, false].map(|with_late| links::sampled(run, with_late, &events));
    let measured = |chain: &Chain| {
        let times = |by| chain.latencies_by(by, &run.task_set, events.iter().copied());
        let [times, judged] = sampled.each_ref().map(times);
        let bounds = &run.bounds_ns;
        let (links, wrong_ns) = links::of_chain(run, chain);
        let output_age = chain.output_age_bound_over_links_ns(&run.task_set, bounds, &links);
        let reaction = match links.first() {
            None => chain.reaction_bound_ns(&run.task_set, bounds),
            // Messages may be lost.
            Some((link, _)) => Err(link.reader.0),
        };
        let names = chain.names(&run.task_set).map(|name| name.to_string());
        let judged = [judged.output_age_ns, judged.data_age_ns, judged.reaction_ns];
        let longest_ns = judged.map(|times_ns| times_ns.into_iter().max().unwrap_or(0));
        // Reaction time and data age have the same bound.
        MeasuredChain {
            names: names.collect(),
            times: [
                (Distribution::new(times.output_age_ns), output_age),
                (Distribution::new(times.data_age_ns), reaction),
                (Distribution::new(times.reaction_ns), reaction),
            ],
            longest_ns: longest_ns.map(|ns| ns.saturating_sub(wrong_ns)),
            stated_ns: links.iter().map(|link| link.1).reduce(u64::saturating_add),
        }
    };
    Ok(chains.iter().map(measured).collect())
}

/// Finds the subtask that an option names.
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
        let _ = writeln!(
            text,
            "  and {more} chains more; `--from DAG/SUBTASK --to DAG/SUBTASK` shows those between \
             two subtasks"
        );
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

/// The figures of one run. Times are in nanoseconds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunFigures {
    /// The number of judged events.
    pub events: usize,
    /// The number of instances that started.
    pub instances: usize,
    /// The number of suspensions.
    pub preemptions: u64,
    /// The first instant from which the trace is complete; 0 if nothing was
    /// lost.
    pub from_ns: u64,
    /// The time from the first judged event to the last.
    pub span_ns: u64,
    /// See the module; 0 if there was none.
    pub finish_to_ready_max_ns: u64,
    /// See the module.
    pub ready_to_start: Distribution,
    /// See the module.
    pub preemption: Distribution,
    /// See the module.
    pub longest_inversion_ns: u64,
    /// See the module; by core.
    pub load_permille: Vec<u64>,
}

/// Computes the figures of a run.
fn compute(view: &View<'_>, finish_to_ready_max_ns: u64, waits: WaitCounts) -> RunFigures {
    let first_ns = view.events.first().map_or(0, |event| event.time_ns);
    let span_ns = view.end_ns.saturating_sub(first_ns);
    let histories = view.histories.values();
    RunFigures {
        events: view.events.len(),
        instances: histories.filter(|it| it.start_ns.is_some()).count(),
        preemptions: view.histories.values().map(|it| it.suspensions).sum(),
        from_ns: view.from_ns,
        span_ns,
        finish_to_ready_max_ns,
        ready_to_start: Distribution::new(waits.ready_to_start_ns),
        preemption: Distribution::new(preemption_latencies_ns(view)),
        longest_inversion_ns: waits.longest_owed_ns,
        load_permille: load_permille(view, first_ns, span_ns),
    }
}

fn preemption_latencies_ns(view: &View<'_>) -> Vec<u64> {
    let mut latencies_ns = Vec::new();
    // For each core, the time of the next request after the one at hand.
    let mut next_ns: BTreeMap<CoreId, u64> = BTreeMap::new();
    // Backwards, so that the next request for the core is known already.
    let requests = view.events.iter().rev();
    for event in requests.filter(|event| event.what == EventKind::Request) {
        let overtaken_ns = next_ns.insert(event.core, event.time_ns);
        let history = event.instance().and_then(|it| view.histories.get(&it));
        let slices = history.map_or(&[][..], |history| &history.slices);
        let mut later = slices.iter().filter(|it| it.from_ns >= event.time_ns);
        // The instance must come to this core, and before the core is wanted for another.
        if let Some(slice) = later.next()
            && slice.core == event.core
            && overtaken_ns.is_none_or(|overtaken_ns| slice.from_ns <= overtaken_ns)
        {
            latencies_ns.push(slice.from_ns - event.time_ns);
        }
    }
    latencies_ns
}

fn load_permille(view: &View<'_>, first_ns: u64, span_ns: u64) -> Vec<u64> {
    let mut busy_ns: BTreeMap<CoreId, u64> = BTreeMap::new();
    for slice in view.histories.values().flat_map(|it| &it.slices) {
        // An instance that ran when the trace ended has its core up to there.
        let to_ns = slice.to_ns.unwrap_or(view.end_ns);
        let from_ns = slice.from_ns.max(first_ns);
        let busy_ns = busy_ns.entry(slice.core).or_insert(0);
        *busy_ns = busy_ns.saturating_add(to_ns.saturating_sub(from_ns));
    }
    let permille = |core: u32| {
        let busy_ns = busy_ns.get(&CoreId(core)).copied().unwrap_or(0);
        let permille = u128::from(busy_ns) * 1000 / u128::from(span_ns.max(1));
        u64::try_from(permille).unwrap_or(u64::MAX)
    };
    (0..view.run.options.cores).map(permille).collect()
}

/// A run in the order of time.
struct View<'r> {
    run: &'r Run,
    /// The first instant from which on no event is missing.
    from_ns: u64,
    /// The time of the last event.
    end_ns: u64,
    /// The events from `from_ns` on, by time.
    events: Vec<Event>,
    histories: BTreeMap<Instance, History>,
    /// The jobs, each with its history.
    jobs: BTreeMap<(DagId, u64), JobHistory>,
    /// The due times of sporadic jobs.
    due_ns: BTreeMap<(DagId, u64), u64>,
}

/// The times of a job's first events of each kind.
#[derive(Clone, Debug, Default)]
struct JobHistory {
    released_ns: Option<u64>,
    aborted_ns: Option<u64>,
    missed_ns: Option<u64>,
    completed_ns: Option<u64>,
}

/// The times of an instance's first events of each kind.
#[derive(Clone, Debug, Default)]
struct History {
    ready_ns: Option<u64>,
    start_ns: Option<u64>,
    finish_ns: Option<u64>,
    /// The time of its cancellation, or of its end by a fault.
    dropped_ns: Option<u64>,
    /// The times on a core.
    slices: Vec<Slice>,
    /// When each wait began and ended; `None`: it went on when the trace ended.
    waits: Vec<(u64, Option<u64>)>,
    suspensions: u64,
}

/// A stretch of execution on one core.
#[derive(Clone, Copy, Debug)]
struct Slice {
    core: CoreId,
    from_ns: u64,
    /// `None`: it ran when the trace ended.
    to_ns: Option<u64>,
}

impl<'r> View<'r> {
    /// Builds the view of a run.
    fn new(run: &'r Run) -> View<'r> {
        let mut view = View {
            run,
            from_ns: complete_from_ns(run),
            end_ns: 0,
            events: Vec::new(),
            histories: BTreeMap::new(),
            jobs: BTreeMap::new(),
            due_ns: BTreeMap::new(),
        };
        view.events = view.in_the_order_of_the_log().collect();
        // Stable: events of one instant keep the order of the journal.
        view.events.sort_by_key(|event| event.time_ns);
        view.end_ns = view.events.last().map_or(view.from_ns, |last| last.time_ns);
        for event in &view.events {
            let of_job = (event.dag, event.job);
            match (event.what, event.instance()) {
                (EventKind::Request, _) => {}
                (_, Some(instance)) => {
                    let history = view.histories.entry(instance).or_default();
                    history.note(event, run.lost > 0, view.from_ns);
                }
                (EventKind::Due, None) => {
                    view.due_ns.insert(of_job, event.time_ns);
                }
                (EventKind::Signalled | EventKind::Dropped, None) => {}
                (what, None) if what.is_of_dag() => {}
                (_, None) => view.jobs.entry(of_job).or_default().note(event),
            }
        }
        view
    }

    /// Returns the judged events in the order of the journal.
    fn in_the_order_of_the_log(&self) -> impl Iterator<Item = Event> {
        let events = self.run.events.iter().copied();
        events.filter(|event| event.time_ns >= self.from_ns)
    }

    /// Returns the nominal release of a job; 0 if that of a sporadic one is unknown.
    fn release_ns(&self, dag: DagId, job: u64) -> u64 {
        let model = self.run.task_set.dag(dag);
        match model.is_sporadic() {
            true => self.due_ns.get(&(dag, job)).copied().unwrap_or(0),
            false => model.grid_ns(job),
        }
    }

    /// Returns the absolute deadline of a job.
    fn deadline_ns(&self, dag: DagId, job: u64) -> u64 {
        let relative_ns = self.run.task_set.dag(dag).relative_deadline_ns();
        self.release_ns(dag, job).saturating_add(relative_ns)
    }
}

/// Returns the first instant after which no event is missing.
fn complete_from_ns(run: &Run) -> u64 {
    if run.lost == 0 {
        return 0;
    }
    // Ends of turns and due times may be dated before their writing; the others bear the time at
    // which they were written, so every lost event is older.
    let is_dated_back = |what| matches!(what, EventKind::Finish | EventKind::Wait | EventKind::Due);
    let mut events = run.events.iter();
    let first = events.find(|event| !is_dated_back(event.what));
    // Other events of that very instant may be lost.
    first.map_or(u64::MAX, |first| first.time_ns.saturating_add(1))
}

impl JobHistory {
    fn note(&mut self, event: &Event) {
        let place = match event.what {
            EventKind::Released => &mut self.released_ns,
            EventKind::Aborted => &mut self.aborted_ns,
            EventKind::Missed => &mut self.missed_ns,
            EventKind::Completed => &mut self.completed_ns,
            _ => return,
        };
        place.get_or_insert(event.time_ns);
    }
}

impl History {
    /// Returns the time when the instance was over: finished, cancelled or ended.
    fn over_ns(&self) -> Option<u64> {
        self.finish_ns.or(self.dropped_ns)
    }

    /// Returns the wait that ended a stretch of execution, if one did.
    fn wait_after(&self, slice: Slice) -> Option<(u64, Option<u64>)> {
        let mut waits = self.waits.iter().copied();
        waits.find(|(from_ns, _)| slice.to_ns == Some(*from_ns))
    }

    fn note(&mut self, event: &Event, is_lossy: bool, from_ns: u64) {
        let time_ns = event.time_ns;
        // A resumption needs no such start: it begins a slice by itself.
        let is_first = self.slices.is_empty() && self.start_ns.is_none();
        let ran = matches!(
            event.what,
            EventKind::Suspend | EventKind::Wait | EventKind::Finish | EventKind::Ended
        );
        if is_lossy && is_first && ran {
            // Its start is lost: it has run since before the trace.
            self.begin_slice(event.core, from_ns);
        }
        // Any later event of the instance ends the slice; a second one does not move its end.
        if let Some(slice) = self.slices.last_mut() {
            slice.to_ns.get_or_insert(time_ns);
        }
        if let Some((_, to_ns)) = self.waits.last_mut() {
            to_ns.get_or_insert(time_ns);
        }
        let place = match event.what {
            EventKind::Ready => &mut self.ready_ns,
            EventKind::Start => &mut self.start_ns,
            EventKind::Finish => &mut self.finish_ns,
            EventKind::Cancelled | EventKind::Ended => &mut self.dropped_ns,
            _ => &mut None,
        };
        place.get_or_insert(time_ns);
        self.suspensions += u64::from(event.what == EventKind::Suspend);
        if event.what == EventKind::Wait {
            self.waits.push((time_ns, None));
        }
        if matches!(event.what, EventKind::Start | EventKind::Resume) {
            self.begin_slice(event.core, time_ns);
        }
    }

    fn begin_slice(&mut self, core: CoreId, from_ns: u64) {
        self.slices.push(Slice {
            core,
            from_ns,
            to_ns: None,
        });
    }
}

#[cfg(test)]
mod tests;
