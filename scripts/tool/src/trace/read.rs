//! Reading the runs out of a log: kinds `trace_begin` to `trace_end`.
//!
//! The log is a serial log or any file of JSON lines; lines of other kinds and
//! lines for people are passed over, also within a run. A trace that is not as
//! `docs/trace-format.md` says is [`Malformed`] with its line, so that a
//! damaged log is never taken for a good run or for a breach. Its DAGs are verified as a
//! commit verifies them. A count that memory is taken for is held against the most that
//! there can be before.

use std::collections::BTreeMap;

use sched_dag::journal::{Event, What};
use sched_dag::{Clusters, CoreId, DagId, DagSpec, SubtaskId, TaskSet};

use super::line::Line;
use super::model::Run;
use super::{bound, commit, dag};
use crate::json::Value;
use crate::protocol::read_line;
use replay::lines::Malformed;
use replay::shown::quoted;

/// A run of which not all lines are read.
struct Open {
    /// Without its model.
    run: Run,
    /// How its cores are divided.
    clusters: Clusters,
    dags: Vec<DagSpec>,
    /// The line of each DAG.
    lines: Vec<usize>,
}

/// Reads all runs of a log; there may be none.
///
/// # Errors
///
/// The first line that is damaged or out of place.
pub fn read(log: &str) -> Result<Vec<Run>, Malformed> {
    let mut runs: Vec<Run> = Vec::new();
    let mut open: Option<Open> = None;
    // A line of a trace that something before its `{` makes one for people.
    let mut spoilt = None;
    let mut usual_bound_ns = bound::REAL_NS;
    let mut commit = commit::Open::default();
    for (index, text) in log.lines().enumerate() {
        let Some(line) = read_line(index + 1, text) else {
            if text.contains("{\"kind\":\"trace_begin\"") {
                spoilt = Some(index + 1);
            }
            continue;
        };
        let line = line.map_err(|error| Malformed {
            line: error.number,
            reason: error.message,
        })?;
        let line = Line(&line);
        match (line.0.kind.as_str(), &mut open) {
            ("boot", _) => usual_bound_ns = bound::usual_ns(line.0),
            ("graph", None) => commit.add(&line)?,
            ("trace_begin", None) => {
                let run = begin(&line, usual_bound_ns)?;
                if let Some(first) = runs.iter().find(|first| first.number == run.number) {
                    return Err(line.malformed(format!(
                        "run {} stands here twice, first on line {}; give each boot's log alone",
                        run.number, first.line
                    )));
                }
                let (dags, lines) = (Vec::new(), Vec::new());
                let clusters = dag::clusters(&line)?;
                open = Some(Open {
                    run,
                    clusters,
                    dags,
                    lines,
                });
            }
            ("trace_begin", Some(open)) => {
                let reason = format!("the trace of line {} has not ended yet", open.run.line);
                return Err(line.malformed(reason));
            }
            ("trace_dag", Some(open)) => add_dag(&line, open)?,
            ("trace", Some(open)) => add_events(&line, open)?,
            ("trace_end", Some(_)) => {
                let ended = open.take().map(|open| end(&line, open, &commit));
                runs.extend(ended.transpose()?);
            }
            ("trace_dag" | "trace" | "trace_end", None) => {
                let hint = spoilt.map_or(String::new(), |number| {
                    format!("; that of line {number} does not begin with `{{`")
                });
                return Err(line.malformed(format!("no `trace_begin` comes before it{hint}")));
            }
            _ => {}
        }
    }
    match open {
        None => Ok(runs),
        Some(open) => Err(Malformed {
            line: open.run.line,
            reason: "this trace has no `trace_end`; was the guest killed?".into(),
        }),
    }
}

fn begin(line: &Line<'_>, usual_bound_ns: u64) -> Result<Run, Malformed> {
    Ok(Run {
        number: line.number("run")?,
        line: line.0.number,
        options: dag::options(line)?,
        usual_bound_ns,
        task_set: TaskSet::default(),
        committed: commit::Committed::default(),
        events: Vec::new(),
        lost: 0,
        complete: false,
    })
}

fn add_dag(line: &Line<'_>, open: &mut Open) -> Result<(), Malformed> {
    let (number, expected) = (line.number("dag")?, open.dags.len() as u64);
    if number != expected {
        return Err(line.malformed(format!("dag {number} stands where dag {expected} belongs")));
    }
    if !open.run.events.is_empty() {
        return Err(line.malformed("a DAG is described after the first event"));
    }
    open.dags.push(dag::spec(line)?);
    open.lines.push(line.0.number);
    Ok(())
}

fn add_events(line: &Line<'_>, open: &mut Open) -> Result<(), Malformed> {
    for (index, value) in line.elements("events")?.iter().enumerate() {
        let event = event(open, value)
            .map_err(|reason| line.malformed(format!("event {} of the line: {reason}", index + 1)));
        open.run.events.push(event?);
    }
    Ok(())
}

fn event(open: &Open, value: &Value) -> Result<Event, String> {
    let [time_ns, word, core, dag, job, subtask] = value.elements() else {
        return Err("it is not [time, event, core, dag, job, subtask]".into());
    };
    let number = |what: &str, value: &Value, below: u64| {
        let number = value.as_u64().filter(|&number| number < below);
        number.ok_or_else(|| format!("its {what} is not a number less than {below}"))
    };
    let text = word.as_text().unwrap_or_default();
    let what: What = text
        .parse()
        .map_err(|_| format!("{} is no event", quoted(text)))?;
    let core = number("core", core, u64::from(open.run.options.cores))?;
    let dag = number("dag", dag, open.dags.len() as u64)?;
    let dag = DagId(u32::try_from(dag).map_err(|error| error.to_string())?);
    let subtasks = open.dags[dag.index()].subtasks.len() as u64;
    let subtask = match what.is_of_job() {
        true if *subtask == Value::Integer(-1) => None,
        true => return Err(format!("`{text}` is of a job, and its subtask not -1")),
        false => Some(number("subtask", subtask, subtasks)?),
    };
    let small = |number: u64| u32::try_from(number).map_err(|error| error.to_string());
    Ok(Event {
        time_ns: number("time", time_ns, u64::MAX)?,
        what,
        core: CoreId(small(core)?),
        dag,
        job: number("job", job, u64::MAX)?,
        subtask: subtask.map(small).transpose()?.map(SubtaskId),
    })
}

fn end(line: &Line<'_>, open: Open, commit: &commit::Open) -> Result<Run, Malformed> {
    let options = (open.run.options, &open.clusters);
    let task_set = dag::task_set("trace_dag", options, &open.dags, &open.lines)?;
    let mut run = open.run;
    run.committed = commit.of(&task_set);
    run.task_set = task_set;
    let (stated, found) = (line.number("events")?, run.events.len());
    if stated != found as u64 {
        return Err(line.malformed(format!("{stated} events are announced, {found} are there")));
    }
    run.lost = line.number("lost")?;
    run.complete = line.flag("complete")?;
    in_order(&run).map_err(|core| {
        line.malformed(format!(
            "time goes back in the events of core {}; each core's must be in the order of time",
            core.0
        ))
    })?;
    Ok(run)
}

/// Reports whether each core's own events are in the order of time, or else whose are
/// not.
fn in_order(run: &Run) -> Result<(), CoreId> {
    let mut latest_ns: BTreeMap<CoreId, u64> = BTreeMap::new();
    for event in &run.events {
        // These two state another core, and another time, than those of their making.
        if matches!(event.what, What::Request | What::Due) {
            continue;
        }
        let latest_ns = latest_ns.entry(event.core).or_insert(0);
        if event.time_ns < *latest_ns {
            return Err(event.core);
        }
        *latest_ns = event.time_ns;
    }
    Ok(())
}
