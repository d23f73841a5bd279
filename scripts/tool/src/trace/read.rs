//! Reading the runs out of a log: kinds `trace_begin` to `trace_end`.
//!
//! The log is a serial log or any file of JSON lines; lines of other kinds and
//! lines for people are passed over, also within a run. A trace that is not as
//! `docs/trace-format.md` says is [`Malformed`] with its line, so that a
//! damaged log is never taken for a good run or for a breach. Its DAGs are verified as a
//! commit verifies them. A count that memory is taken for is held against the most that
//! there can be before.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;

use sched_dag::journal::{Event, What};
use sched_dag::{
    Activation, CommitOptions, ConstructionPolicy, CoreId, DagId, DagSpec, OverrunPolicy, Policy,
    Preemption, Priority, SchedulerOptions, SubtaskId, SubtaskSpec, TaskSet, verify,
};

use super::bound;
use super::model::Run;
use crate::json::Value;
use crate::protocol::{MachineLine, read_line};
use crate::qemu::MOST_CORES;
use replay::lines::Malformed;
use replay::shown::quoted;

/// A run of which not all lines are read.
struct Open {
    /// Without its model.
    run: Run,
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
    let mut is_counted = false;
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
            ("boot", _) => is_counted = bound::is_counted(line.0),
            ("trace_begin", None) => {
                let run = begin(&line, is_counted)?;
                if let Some(first) = runs.iter().find(|first| first.number == run.number) {
                    return Err(line.malformed(format!(
                        "run {} stands here twice, first on line {}; give each boot's log alone",
                        run.number, first.line
                    )));
                }
                let (dags, lines) = (Vec::new(), Vec::new());
                open = Some(Open { run, dags, lines });
            }
            ("trace_begin", Some(open)) => {
                let reason = format!("the trace of line {} has not ended yet", open.run.line);
                return Err(line.malformed(reason));
            }
            ("trace_dag", Some(open)) => add_dag(&line, open)?,
            ("trace", Some(open)) => add_events(&line, open)?,
            ("trace_end", Some(_)) => {
                let ended = open.take().map(|open| end(&line, open));
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

fn begin(line: &Line<'_>, is_counted: bool) -> Result<Run, Malformed> {
    let cores = line.within("cores", 1..=MOST_CORES)?;
    Ok(Run {
        number: line.number("run")?,
        line: line.0.number,
        options: SchedulerOptions {
            policy: match line.text("policy")? {
                "static" => Policy::StaticPriority,
                "edf" => Policy::Edf,
                other => return Err(line.unknown("policy", other, "static or edf")),
            },
            preemption: match line.text("preemption")? {
                "on" => Preemption::Enabled,
                "off" => Preemption::Disabled,
                other => return Err(line.unknown("preemption", other, "on or off")),
            },
            cores: line.small(cores)?,
        },
        is_counted,
        task_set: TaskSet::default(),
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
    let subtasks = line.elements("subtasks")?.iter();
    let subtasks = subtasks.map(|it| subtask(line, it));
    let mut subtasks: Vec<SubtaskSpec> = subtasks.collect::<Result<_, _>>()?;
    let in_flight = line.within("in_flight", 1..=u64::from(u32::MAX))?;
    let count = subtasks.len() as u64;
    let edge = |edge: &Value| {
        let ends: Option<Vec<u64>> = edge.elements().iter().map(Value::as_u64).collect();
        let ends = ends.filter(|ends| ends.iter().all(|&end| end < count));
        let Some(&[from, to]) = ends.as_deref() else {
            return Err(line.malformed(format!(
                "an edge is a pair of numbers less than {count}, the number of subtasks"
            )));
        };
        Ok((line.small(from)? as usize, line.small(to)? as usize))
    };
    let edges = line.elements("edges")?.iter().map(edge);
    let edges: Vec<(usize, usize)> = edges.collect::<Result<_, _>>()?;
    add_sinks(line, &mut subtasks, &edges)?;
    open.lines.push(line.0.number);
    open.dags.push(DagSpec {
        name: line.text("name")?.to_string(),
        activation: match line.flag("sporadic")? {
            true => Activation::Sporadic,
            false => Activation::Periodic,
        },
        period_ns: Some(line.within("period_ns", 1..=u64::MAX)?),
        relative_deadline_ns: Some(line.within("relative_deadline_ns", 1..=u64::MAX)?),
        offset_ns: line.number("offset_ns")?,
        in_flight: Some(line.small(in_flight)?),
        overrun: match line.text("overrun")? {
            "queue" => OverrunPolicy::Queue,
            "skip" => OverrunPolicy::Skip,
            "abort" => OverrunPolicy::Abort,
            other => return Err(line.unknown("overrun", other, "queue, skip or abort")),
        },
        subtasks,
        edges,
        ..DagSpec::default()
    });
    Ok(())
}

/// Reads the deadlines of sinks, which are stated if there are several. One that a shared
/// state puts before another counts as that one's predecessor only.
fn add_sinks(
    line: &Line<'_>,
    subtasks: &mut [SubtaskSpec],
    edges: &[(usize, usize)],
) -> Result<(), Malformed> {
    if line.0.value.get("sinks").is_none() {
        return Ok(());
    }
    let followed: BTreeSet<usize> = edges.iter().map(|edge| edge.0).collect();
    for sink in line.elements("sinks")? {
        let pair: Option<Vec<u64>> = sink.elements().iter().map(Value::as_u64).collect();
        let count = subtasks.len() as u64;
        let Some(&[sink, deadline_ns]) = pair.as_deref().filter(|pair| pair.first() < Some(&count))
        else {
            return Err(line.malformed(format!(
                "a sink is a pair of a number less than {count}, the number of subtasks, and its \
                 relative deadline"
            )));
        };
        let sink = line.small(sink)? as usize;
        if !followed.contains(&sink) {
            subtasks[sink].relative_deadline_ns = Some(deadline_ns);
        }
    }
    Ok(())
}

/// Makes the model, as a commit does.
fn model(open: &Open) -> Result<TaskSet, Malformed> {
    let SchedulerOptions { policy, cores, .. } = open.run.options;
    let options = CommitOptions::new(policy, cores)
        .with_construction(ConstructionPolicy::any_graph())
        .with_instance_limit(u32::MAX);
    if open.dags.is_empty() {
        return Ok(TaskSet::default());
    }
    verify(&open.dags, &options)
        .map(|verified| verified.task_set)
        .map_err(|rejected| {
            let is_right = |line: &usize| {
                let before = open.lines.partition_point(|other| other <= line);
                verify(&open.dags[..before], &options).is_ok()
            };
            let wrong = open.lines.partition_point(is_right);
            let faults: Vec<String> = rejected.faults().iter().map(ToString::to_string).collect();
            Malformed {
                line: open.lines.get(wrong).copied().unwrap_or(open.run.line),
                reason: format!("`trace_dag`: {}", faults.join("; ")),
            }
        })
}

fn subtask(line: &Line<'_>, value: &Value) -> Result<SubtaskSpec, Malformed> {
    let read = || {
        let [name, priority, non_preemptive, wcet_ns] = value.elements() else {
            return None;
        };
        let is_wcet = *wcet_ns == Value::Null || wcet_ns.as_u64().is_some();
        let non_preemptive = non_preemptive
            .as_u64()
            .filter(|&flag| flag < 2 && is_wcet)?;
        let priority = u32::try_from(priority.as_u64()?).ok()?;
        Some(SubtaskSpec {
            name: name.as_text()?.to_string(),
            wcet_ns: wcet_ns.as_u64(),
            priority: Some(Priority(priority)),
            non_preemptive: non_preemptive == 1,
            ..SubtaskSpec::default()
        })
    };
    read().ok_or_else(|| {
        line.malformed("a subtask is [name, priority, non-preemptive 0 or 1, WCET or null]")
    })
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

fn end(line: &Line<'_>, open: Open) -> Result<Run, Malformed> {
    let task_set = model(&open)?;
    let mut run = open.run;
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

/// A machine line whose members are asked for.
struct Line<'a>(&'a MachineLine);

impl Line<'_> {
    fn malformed(&self, reason: impl Into<String>) -> Malformed {
        Malformed {
            line: self.0.number,
            reason: format!("`{}`: {}", self.0.kind, reason.into()),
        }
    }

    fn unknown(&self, name: &str, found: &str, allowed: &str) -> Malformed {
        let found = quoted(found);
        self.malformed(format!("`{name}` is {found} and must be {allowed}"))
    }

    /// Returns a member that is true or false, and false if it is left out.
    fn flag(&self, name: &str) -> Result<bool, Malformed> {
        match self.0.value.get(name) {
            None => Ok(false),
            Some(Value::Bool(flag)) => Ok(*flag),
            Some(_) => Err(self.malformed(format!("`{name}` is neither true nor false"))),
        }
    }

    fn within(&self, name: &str, range: RangeInclusive<u64>) -> Result<u64, Malformed> {
        let number = self.number(name)?;
        match range.contains(&number) {
            true => Ok(number),
            false if *range.end() == u64::MAX => {
                let least = range.start();
                Err(self.malformed(format!("`{name}` is {number} and must be at least {least}")))
            }
            false => {
                let (least, most) = range.into_inner();
                let reason = format!("`{name}` is {number} and must be from {least} to {most}");
                Err(self.malformed(reason))
            }
        }
    }

    fn number(&self, name: &str) -> Result<u64, Malformed> {
        let reason = || self.malformed(format!("`{name}` is not a number from 0"));
        self.0.number_at(name).ok_or_else(reason)
    }

    fn text(&self, name: &str) -> Result<&str, Malformed> {
        let reason = || self.malformed(format!("`{name}` is not text"));
        self.0.text_at(name).ok_or_else(reason)
    }

    fn elements(&self, name: &str) -> Result<&[Value], Malformed> {
        match self.0.value.get(name) {
            Some(Value::Array(elements)) => Ok(elements),
            _ => Err(self.malformed(format!("`{name}` is not a list"))),
        }
    }

    fn small(&self, number: u64) -> Result<u32, Malformed> {
        u32::try_from(number).map_err(|error| self.malformed(error.to_string()))
    }
}
