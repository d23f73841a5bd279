//! Reading the runs out of a log: kinds `trace_begin` to `trace_end`.
//!
//! The log is a serial log or any file of JSON lines; lines of other kinds and
//! lines for people are passed over, also within a run. A trace that is not as
//! `docs/trace-format.md` says is [`Malformed`] with its line, so that a
//! damaged log is never taken for a good run or for a breach. A count that memory
//! is taken for is held against the most that there can be before.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use sched_dag::{CoreId, DagId, Policy, Preemption, SubtaskId};

use super::bound;
use super::model::{Dag, Event, Releases, Run, Subtask, What};
use crate::json::Value;
use crate::protocol::{MachineLine, read_line};
use crate::qemu::MOST_CORES;
use replay::lines::Malformed;
use replay::shown::quoted;

/// Reads all runs of a log; there may be none.
///
/// # Errors
///
/// The first line that is damaged or out of place.
pub fn read(log: &str) -> Result<Vec<Run>, Malformed> {
    let mut runs: Vec<Run> = Vec::new();
    let mut open: Option<Run> = None;
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
                open = Some(run);
            }
            ("trace_begin", Some(run)) => {
                let reason = format!("the trace of line {} has not ended yet", run.line);
                return Err(line.malformed(reason));
            }
            ("trace_dag", Some(run)) => add_dag(&line, run)?,
            ("trace", Some(run)) => add_events(&line, run)?,
            ("trace_end", Some(run)) => {
                end(&line, run)?;
                runs.extend(open.take());
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
        Some(run) => Err(Malformed {
            line: run.line,
            reason: "this trace has no `trace_end`; was the guest killed?".into(),
        }),
    }
}

fn begin(line: &Line<'_>, is_counted: bool) -> Result<Run, Malformed> {
    let cores = line.within("cores", 1..=MOST_CORES)?;
    Ok(Run {
        number: line.number("run")?,
        line: line.0.number,
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
        is_counted,
        dags: Vec::new(),
        events: Vec::new(),
        lost: 0,
        complete: false,
    })
}

fn add_dag(line: &Line<'_>, run: &mut Run) -> Result<(), Malformed> {
    let (number, expected) = (line.number("dag")?, run.dags.len() as u64);
    if number != expected {
        return Err(line.malformed(format!("dag {number} stands where dag {expected} belongs")));
    }
    if !run.events.is_empty() {
        return Err(line.malformed("a DAG is described after the first event"));
    }
    match line.text("overrun")? {
        "queue" | "skip" | "abort" => {}
        other => return Err(line.unknown("overrun", other, "queue, skip or abort")),
    }
    line.within("in_flight", 1..=u64::from(u32::MAX))?;
    let subtasks = line
        .elements("subtasks")?
        .iter()
        .map(|it| subtask(line, it));
    let subtasks: Vec<Subtask> = subtasks.collect::<Result<_, _>>()?;
    let mut predecessors = vec![Vec::new(); subtasks.len()];
    let mut followed: Vec<Vec<u32>> = vec![Vec::new(); subtasks.len()];
    for edge in line.elements("edges")? {
        let ends: Option<Vec<u64>> = edge.elements().iter().map(Value::as_u64).collect();
        let count = subtasks.len() as u64;
        let ends = ends.filter(|ends| ends.iter().all(|&end| end < count));
        let Some(&[from, to]) = ends.as_deref() else {
            return Err(line.malformed(format!(
                "an edge is a pair of numbers less than {count}, the number of subtasks"
            )));
        };
        let (from, to) = (line.small(from)?, line.small(to)?);
        predecessors[to as usize].push(SubtaskId(from));
        followed[from as usize].push(to);
    }
    if has_cycle(&followed) {
        return Err(line.malformed("`edges` have a cycle, which no commit lets pass"));
    }
    for before in &mut predecessors {
        before.sort_unstable();
        before.dedup();
    }
    run.dags.push(Dag {
        name: line.text("name")?.to_string(),
        period_ns: line.within("period_ns", 1..=u64::MAX)?,
        relative_deadline_ns: line.within("relative_deadline_ns", 1..=u64::MAX)?,
        offset_ns: line.number("offset_ns")?,
        sporadic: releases(line)?,
        subtasks,
        predecessors,
    });
    Ok(())
}

/// Reports whether subtasks come before themselves; `followed` has the successors of
/// each.
fn has_cycle(followed: &[Vec<u32>]) -> bool {
    let mut waits_for = vec![0_u32; followed.len()];
    for &to in followed.iter().flatten() {
        waits_for[to as usize] += 1;
    }
    let is_free = |subtask: &usize| waits_for[*subtask] == 0;
    let mut free: Vec<usize> = (0..followed.len()).filter(is_free).collect();
    let mut ordered = 0;
    while let Some(subtask) = free.pop() {
        ordered += 1;
        for &to in &followed[subtask] {
            waits_for[to as usize] -= 1;
            if waits_for[to as usize] == 0 {
                free.push(to as usize);
            }
        }
    }
    ordered < followed.len()
}

/// Reads the releases of a sporadic DAG.
fn releases(line: &Line<'_>) -> Result<Option<Releases>, Malformed> {
    if !line.flag("sporadic")? {
        return Ok(None);
    }
    let mut times_ns = BTreeMap::new();
    if line.0.value.get("releases").is_none() {
        return Ok(Some(Releases::default()));
    }
    for release in line.elements("releases")? {
        let pair: Option<Vec<u64>> = release.elements().iter().map(Value::as_u64).collect();
        let Some(&[job, time_ns]) = pair.as_deref() else {
            return Err(line.malformed("a release is a pair of a job and a time"));
        };
        if times_ns.insert(job, time_ns).is_some() {
            return Err(line.malformed(format!("the release of job {job} stands here twice")));
        }
    }
    Ok(Some(Releases {
        are_exact: !times_ns.is_empty(),
        times_ns,
    }))
}

/// Takes the releases of sporadic DAGs from the events. Where they do not state one,
/// it is taken to be when the scheduler first dealt with the job.
fn find_releases(run: &mut Run) {
    for event in &run.events {
        if event.what == What::Due
            && let Some(releases) = &mut run.dags[event.dag.index()].sporadic
        {
            releases.times_ns.insert(event.job, event.time_ns);
            releases.are_exact = true;
        }
    }
    for event in &run.events {
        let is_due = matches!(event.what, What::Released | What::Queued | What::Skipped);
        if let Some(releases) = &mut run.dags[event.dag.index()].sporadic
            && is_due
            && !releases.are_exact
        {
            let time_ns = releases.times_ns.entry(event.job).or_insert(event.time_ns);
            *time_ns = event.time_ns.min(*time_ns);
        }
    }
}

fn subtask(line: &Line<'_>, value: &Value) -> Result<Subtask, Malformed> {
    let read = || {
        let [name, priority, non_preemptive, wcet_ns] = value.elements() else {
            return None;
        };
        let is_wcet = *wcet_ns == Value::Null || wcet_ns.as_u64().is_some();
        let non_preemptive = non_preemptive
            .as_u64()
            .filter(|&flag| flag < 2 && is_wcet)?;
        Some(Subtask {
            name: name.as_text()?.to_string(),
            priority: u32::try_from(priority.as_u64()?).ok()?,
            non_preemptive: non_preemptive == 1,
        })
    };
    read().ok_or_else(|| {
        line.malformed("a subtask is [name, priority, non-preemptive 0 or 1, WCET or null]")
    })
}

fn add_events(line: &Line<'_>, run: &mut Run) -> Result<(), Malformed> {
    for (index, value) in line.elements("events")?.iter().enumerate() {
        let event = event(run, value)
            .map_err(|reason| line.malformed(format!("event {} of the line: {reason}", index + 1)));
        run.events.push(event?);
    }
    Ok(())
}

fn event(run: &Run, value: &Value) -> Result<Event, String> {
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
    let core = number("core", core, u64::from(run.cores))?;
    let dag = number("dag", dag, run.dags.len() as u64)?;
    let dag = DagId(u32::try_from(dag).map_err(|error| error.to_string())?);
    let subtasks = run.dags[dag.index()].subtasks.len() as u64;
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

fn end(line: &Line<'_>, run: &mut Run) -> Result<(), Malformed> {
    let (stated, found) = (line.number("events")?, run.events.len());
    if stated != found as u64 {
        return Err(line.malformed(format!("{stated} events are announced, {found} are there")));
    }
    run.lost = line.number("lost")?;
    run.complete = line.flag("complete")?;
    find_releases(run);
    in_order(run).map_err(|core| {
        line.malformed(format!(
            "time goes back in the events of core {}; each core's must be in the order of time",
            core.0
        ))
    })
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
