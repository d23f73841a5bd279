//! Files of WCETs that were observed: writing one, and refusing what a commit would refuse.
//!
//! `sched_dag::wcets` has the format and its reader, which the guest's commit uses, too. A
//! file is refused here for what can be seen without the DAGs; the rest the commit says.

use std::fmt::Write;
use std::path::Path;

use sched_dag::law::Distribution;
use sched_dag::wcets::{Record, records};

use super::observed::OfDag;
use crate::files;

/// What is added to the longest call if nobody says how much, in hundredths of it.
pub const MARGIN_PERCENT: u64 = 20;

/// Returns a file of the longest calls and a margin. A subtask that never ran has none.
#[must_use]
pub fn text(all: &[OfDag], margin_percent: u64) -> String {
    let mut text = String::from(
        "# WCETs that were observed, by `./scripts/run --observe`: a margin in per cent, then of\n\
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
    let ns = u128::from(longest_ns) * u128::from(100 + margin_percent);
    u64::try_from(ns.div_ceil(100)).unwrap_or(u64::MAX).max(1)
}

/// Reads a file of WCETs, which a commit can then only refuse because of its DAGs.
///
/// # Errors
///
/// In words, with file and line.
pub fn read(path: &Path) -> Result<String, String> {
    let text = files::read_text(path)?;
    let refuse = |line: usize, why: &str| format!("{}:{line}: {why}", files::place(path));
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
            Record::Margin(_) => {}
            Record::Dag { hash, .. } if hashes.contains(&hash) => {
                return Err(refuse(line, "this DAG stands here twice; give it once"));
            }
            Record::Dag { hash, .. } => {
                hashes.push(hash);
                numbers.clear();
                has_dag = true;
            }
            Record::Wcet { .. } if !has_dag => {
                return Err(refuse(
                    line,
                    "a WCET before the first DAG; put a `dag` before it",
                ));
            }
            Record::Wcet { subtask, .. } if numbers.contains(&subtask) => {
                return Err(refuse(line, "this subtask stands here twice; give it once"));
            }
            Record::Wcet { subtask, .. } => numbers.push(subtask),
            Record::End => has_ended = true,
        }
    }
    match (has_ended, has_dag) {
        (false, _) => {
            let why = "the file does not end by `end`; is a part of it missing?";
            Err(refuse(last.max(1), why))
        }
        (_, false) => Err(refuse(last, "there is no `dag` in it; observe a run")),
        _ => Ok(text),
    }
}

/// Returns what the guest says of the file, by its name and line; `None` if it speaks of
/// something else.
#[must_use]
pub fn translate(said: &str, path: &Path) -> Option<String> {
    let (before, rest) = said.split_once("line ")?;
    let (line, after) = rest.split_once(" of the WCETs: ")?;
    let is_line = !line.is_empty() && line.bytes().all(|byte| byte.is_ascii_digit());
    is_line.then(|| format!("{before}{}:{line}: {after}", files::place(path)))
}

/// Returns the table of what was observed.
#[must_use]
pub fn table(all: &[OfDag], margin_percent: u64) -> String {
    let mut text = String::new();
    for dag in all {
        // Writing into a `String` cannot fail.
        let _ = writeln!(
            text,
            "\n{:<24}{:>8}{:>12}{:>12}{:>12}{:>12}{:>12}  from min to max",
            format!("dag {}", dag.name),
            "calls",
            "min",
            "median",
            "p99",
            "max",
            format!("max+{margin_percent}%")
        );
        for (name, times) in &dag.subtasks {
            let figures = [times.min(), times.median(), times.p99(), times.max()];
            let _ = write!(text, "  {name:<22}{:>8}", times.count());
            for ns in figures
                .into_iter()
                .chain([with_margin(times.max(), margin_percent)])
            {
                let _ = write!(text, "{:>12}", shown(ns));
            }
            let _ = writeln!(text, "  {}", bars(times));
        }
    }
    text
}

/// Returns a time in the unit that has one to three digits before the point.
#[must_use]
pub fn shown(ns: u64) -> String {
    let units = [(1_000_000_000, "s"), (1_000_000, "ms"), (1_000, "us")];
    match units.into_iter().find(|(unit, _)| ns >= *unit) {
        None => format!("{ns} ns"),
        Some((unit, name)) => format!("{}.{:03} {name}", ns / unit, ns % unit / (unit / 1000)),
    }
}

/// Returns a histogram of ten equal parts between the smallest and the largest value.
fn bars(times: &Distribution) -> String {
    const PARTS: usize = 10;
    const HEIGHTS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let mut parts = [0; PARTS];
    let width = (times.max() - times.min()).max(1);
    for (top, count) in times.values() {
        let from = u128::from(top - times.min());
        let part = from * PARTS as u128 / u128::from(width);
        parts[usize::try_from(part).map_or(PARTS - 1, |part| part.min(PARTS - 1))] += count;
    }
    let most = parts.into_iter().max().unwrap_or(0).max(1);
    let height = |&count: &u64| match count {
        0 => ' ',
        _ => {
            let height = u128::from(count) * 7 / u128::from(most);
            HEIGHTS[usize::try_from(height).map_or(7, |height| height.min(7))]
        }
    };
    parts.iter().map(height).collect()
}
