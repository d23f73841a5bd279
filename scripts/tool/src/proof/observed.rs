//! Observed times of runs: execution times per subtask, response times per DAG, and the platform's
//! overheads.
//!
//! Runs of several boots can be added up: two DAGs count as the same DAG if the hashes of their
//! names and edges are equal.
//!
//! The overheads are measured from the journal of a run: `sched_dag::law::MeasuredCosts` defines
//! the measurement, `sched_dag::analysis::Overheads::measured` the resulting charge.
//!
//! Observed WCETs go to files, for later commits. `sched_dag::wcets` defines the format and the
//! reader, which the guest's commit uses, too. This module refuses faults visible without the DAGs;
//! the commit reports the others.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use recording::Counted;
use sched_dag::analysis::Overheads;
use sched_dag::law::{Distribution, MeasuredCosts};
use sched_dag::wcets::{self, records};

use crate::files;
use views::findings::check;
use views::json::Object;
use views::record::{Record, Run};
use views::units::shown;

/// The observed times of a DAG, identified by names and edges, in all its runs.
#[derive(Clone, Debug)]
pub struct ObservedDag {
    /// Its name.
    pub name: String,
    /// The hash of its names and edges.
    pub hash: u64,
    /// The longest response time in nanoseconds, by the commit's number.
    pub longest_responses_ns: BTreeMap<usize, u64>,
    /// Its subtasks, by number: name and execution times in nanoseconds.
    pub subtasks: Vec<(String, Distribution)>,
}

/// Adds the times of a boot's runs to earlier times.
///
/// # Errors
///
/// In words: there are no times, or a DAG's times do not fit its subtasks.
pub fn add(all: &mut Vec<ObservedDag>, record: &Record) -> Result<(), String> {
    let mut is_told = false;
    for (place, times) in &record.times {
        let committed = &record.commits[*place];
        is_told |= !times.dags.is_empty();
        for (dag, times) in committed.told.dags.iter().zip(&times.dags) {
            // A record is a person's file and may combine a commit with the times of another
            // commit.
            if times.subtasks.len() != dag.subtasks.len() {
                return Err(format!(
                    "the times of dag `{}` are not of its subtasks",
                    dag.name
                ));
            }
            let place = all.iter().position(|other| other.hash == dag.hash);
            // A DAG of this shape was not seen before.
            let place = place.unwrap_or_else(|| {
                let names = dag.subtasks.iter().map(|subtask| subtask.name.clone());
                all.push(ObservedDag {
                    name: dag.name.clone(),
                    hash: dag.hash,
                    longest_responses_ns: BTreeMap::new(),
                    subtasks: names.map(|name| (name, Distribution::default())).collect(),
                });
                all.len() - 1
            });
            let of_dag = &mut all[place];
            let longest_ns = distribution(&times.response).max();
            // By commit: the bounds of two commits of one DAG may differ.
            let so_far = of_dag.longest_responses_ns.entry(committed.number);
            let so_far = so_far.or_default();
            *so_far = longest_ns.max(*so_far);
            for ((_, seen), times) in of_dag.subtasks.iter_mut().zip(&times.subtasks) {
                seen.add(&distribution(&times.execution));
            }
        }
    }
    match is_told {
        true => Ok(()),
        false => Err("the guest has run no DAG, or was told to record nothing".into()),
    }
}

/// Makes a distribution from the counts of a record.
pub fn distribution(counted: &Counted) -> Distribution {
    Distribution::counted(counted.min_ns, counted.buckets.clone())
}

/// Returns a machine line for each subtask.
pub fn lines(all: &[ObservedDag]) -> impl Iterator<Item = String> {
    let of_dag = |dag: &ObservedDag| -> Vec<String> {
        let lines = dag.subtasks.iter().map(|(name, times)| {
            let buckets = times.values();
            let buckets = buckets.map(|(top, count)| format!("[{top},{count}]"));
            let times_ns = Object::new()
                .number("count", times.count())
                .number("min", times.min())
                .number("median", times.median())
                .number("p99", times.p99())
                .number("max", times.max())
                .into_text();
            Object::new()
                .text("kind", "observed")
                .text("dag", &dag.name)
                .number("hash", dag.hash)
                .text("subtask", name)
                .json("execution_time_ns", &times_ns)
                .list("execution_histogram", buckets)
                .into_text()
        });
        lines.collect()
    };
    all.iter().flat_map(of_dag)
}

/// Measures the overheads in a guest's runs, and returns the largest of all runs.
///
/// # Errors
///
/// In words: the guest has run nothing.
pub fn measure(runs: &[Run]) -> Result<MeasuredCosts, String> {
    let costs = runs.iter().map(of_run).reduce(|one, other| MeasuredCosts {
        dispatches: one.dispatches + other.dispatches,
        owed_ns: one.owed_ns.max(other.owed_ns),
        releases: one.releases + other.releases,
        late_ns: one.late_ns.max(other.late_ns),
    });
    costs.ok_or_else(|| "the guest has run nothing".into())
}

fn of_run(run: &Run) -> MeasuredCosts {
    // With an unlimited tolerance nothing is a breach; only the figures are needed.
    let figures = check(run, u64::MAX).figures;
    MeasuredCosts {
        dispatches: figures.instances as u64,
        owed_ns: figures.longest_inversion_ns,
        ..MeasuredCosts::of_releases(&run.task_set, run.events.iter().copied())
    }
}

/// Returns the guest's word for the charged overheads, with a margin in per cent.
pub fn overheads_word(measured: &MeasuredCosts, margin_percent: u64) -> String {
    let margin_percent = u32::try_from(margin_percent).unwrap_or(u32::MAX);
    let overheads = Overheads::measured(measured, margin_percent, 0);
    format!("overheads_ns={}", overheads.stated())
}

/// Returns the measured overheads as a machine line.
pub fn overheads_line(measured: &MeasuredCosts, margin_percent: u64) -> String {
    Object::new()
        .text("kind", "overheads")
        .number("dispatches", measured.dispatches)
        .number("owed_ns", measured.owed_ns)
        .number("releases", measured.releases)
        .number("late_ns", measured.late_ns)
        .number("margin_percent", margin_percent)
        .into_text()
}

/// The default margin on the longest call, in per cent of the call.
pub const MARGIN_PERCENT: u64 = 20;

/// Returns a file of the longest calls with a margin, without subtasks that never ran.
pub fn text(all: &[ObservedDag], margin_percent: u64) -> String {
    let mut text = String::from(
        "# WCETs that were observed, by `./scripts/recording --observe`: a margin in per cent, then of\n\
         # each DAG a hash of its names and edges, and of each subtask the longest call and the\n\
         # margin in ns, its number and its name. Observed is not proven: other inputs may take\n\
         # longer. A subtask whose line is taken out keeps the WCET that is stated.\n",
    );
    // Writing into a `String` cannot fail.
    let _ = writeln!(text, "margin {margin_percent}");
    for dag in all {
        let _ = writeln!(text, "dag {} {}", dag.hash, dag.name);
        for (number, (name, times)) in dag.subtasks.iter().enumerate() {
            if times.count() > 0 {
                let wcet_ns = with_margin(times.max(), margin_percent);
                let _ = writeln!(text, "wcet {wcet_ns} {number} {name}");
            }
        }
    }
    text + "end\n"
}

fn with_margin(longest_ns: u64, margin_percent: u64) -> u64 {
    // In 128 bits: a long call times the factor may exceed 64.
    let ns = u128::from(longest_ns) * u128::from(100 + margin_percent);
    // Rounded up, and at least 1: the commit takes no WCET of 0.
    u64::try_from(ns.div_ceil(100)).unwrap_or(u64::MAX).max(1)
}

/// Reads a file of WCETs, and checks everything independent of the DAGs.
///
/// # Errors
///
/// In words, with file and line.
pub fn read(path: &Path) -> Result<String, String> {
    let text = files::read_text(path)?;
    let refuse = |line: usize, why: &str| format!("{}:{line}: {why}", files::shown_path(path));
    let (mut last, mut has_dag, mut hashes) = (0, false, Vec::new());
    let mut numbers = Vec::new();
    let mut has_ended = false;
    for record in records(&text) {
        let (line, record) = record.map_err(|fault| refuse(fault.line, fault.problem))?;
        if has_ended {
            return Err(refuse(line, "more follows after `end`; put it before"));
        }
        last = line;
        match record {
            wcets::WcetRecord::Margin(_) => {}
            wcets::WcetRecord::Dag { hash, .. } if hashes.contains(&hash) => {
                return Err(refuse(line, "this DAG stands here twice; give it once"));
            }
            wcets::WcetRecord::Dag { hash, .. } => {
                hashes.push(hash);
                // Numbers of subtasks count anew in each DAG.
                numbers.clear();
                has_dag = true;
            }
            wcets::WcetRecord::Wcet { .. } if !has_dag => {
                return Err(refuse(
                    line,
                    "a WCET before the first DAG; put a `dag` before it",
                ));
            }
            wcets::WcetRecord::Wcet { subtask, .. } if numbers.contains(&subtask) => {
                return Err(refuse(line, "this subtask stands here twice; give it once"));
            }
            wcets::WcetRecord::Wcet { subtask, .. } => numbers.push(subtask),
            wcets::WcetRecord::End => has_ended = true,
        }
    }
    match (has_ended, has_dag) {
        // A truncated file must not pass as a file with fewer WCETs.
        (false, _) => {
            let why = "the file does not end by `end`; is a part of it missing?";
            Err(refuse(last.max(1), why))
        }
        (_, false) => Err(refuse(last, "there is no `dag` in it; observe a run")),
        _ => Ok(text),
    }
}

/// Translates a guest's refusal of the file into a message with the file's name and line; returns
/// `None` for a message about anything else.
pub fn translate(said: &str, path: &Path) -> Option<String> {
    let (before, rest) = said.split_once("line ")?;
    let (line, after) = rest.split_once(" of the WCETs: ")?;
    let is_line = !line.is_empty() && line.bytes().all(|byte| byte.is_ascii_digit());
    is_line.then(|| format!("{before}{}:{line}: {after}", files::shown_path(path)))
}

/// Returns the table of the observed times.
pub fn table(all: &[ObservedDag], margin_percent: u64) -> String {
    let mut text = String::new();
    for dag in all {
        // Writing into a `String` cannot fail.
        let (name, last) = (
            format!("dag {}", dag.name),
            format!("max+{margin_percent}%"),
        );
        let titles = ["min", "median", "p99", "max", &last];
        let titles = titles.map(|title| format!("{title:>12}")).concat();
        let _ = writeln!(text, "\n{name:<24}   calls{titles}  from min to max");
        for (name, times) in &dag.subtasks {
            let last = with_margin(times.max(), margin_percent);
            let figures = [times.min(), times.median(), times.p99(), times.max(), last];
            let figures = figures.map(|ns| format!("{:>12}", shown(ns))).concat();
            let (count, bars) = (times.count(), bars(times));
            let _ = writeln!(text, "  {name:<22}{count:>8}{figures}  {bars}");
        }
    }
    text
}

/// Returns a histogram of ten bins of equal width between the smallest and the largest value.
fn bars(times: &Distribution) -> String {
    const PARTS: usize = 10;
    const HEIGHTS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let mut parts = [0; PARTS];
    let width = (times.max() - times.min()).max(1);
    for (top, count) in times.values() {
        let from = u128::from(top - times.min());
        let part = from * PARTS as u128 / u128::from(width);
        // The largest value falls on the upper end, into the last bin.
        parts[usize::try_from(part).map_or(PARTS - 1, |part| part.min(PARTS - 1))] += count;
    }
    let most = parts.into_iter().max().unwrap_or(0).max(1);
    let height = |&count: &u64| match count {
        0 => ' ',
        _ => {
            // The tallest bin gets the last of the eight heights.
            let height = u128::from(count) * 7 / u128::from(most);
            HEIGHTS[usize::try_from(height).map_or(7, |height| height.min(7))]
        }
    };
    parts.iter().map(height).collect()
}
