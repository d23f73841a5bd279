//! The DAGs of a scenario, as the text states them.

use alloc::string::String;
use alloc::vec::Vec;
use alloc::{format, vec};
use core::time::Duration;

use fass::{FaultLimit, OverrunPolicy};

use crate::number;

/// A DAG: `NAME`, then any of `period T` or `sporadic T`, `deadline T`, `offset T`, `jobs N`,
/// `in-flight N`, `overrun queue|skip|abort`, `survives FAULTS/WINDOW/ALL`, `cluster N`,
/// `affinity N,N`, `paused`, `on-fault DAG`.
///
/// The DAG has one job unless `jobs` is given (`jobs 0`: no end), and room for all of its jobs
/// unless `in-flight` is given.
#[derive(Clone, Debug, Default)]
pub struct DagText {
    pub(crate) name: String,
    pub(crate) period: Duration,
    pub(crate) is_sporadic: bool,
    pub(crate) deadline: Option<Duration>,
    pub(crate) offset: Duration,
    pub(crate) jobs: u64,
    pub(crate) in_flight: Option<u32>,
    pub(crate) overrun: OverrunPolicy,
    pub(crate) survives: Option<FaultLimit>,
    pub(crate) cluster: Option<u32>,
    pub(crate) affinity: Vec<u32>,
    pub(crate) is_paused: bool,
    /// The DAG released by a fault.
    pub(crate) on_fault: Option<String>,
    /// The DAG's subtasks.
    pub subtasks: Vec<SubtaskText>,
}

/// A subtask: `NAME TIMES`, then any of `after NAME NAME`, `priority N`, `wcet T`, `budget T`,
/// `due T` (of a sink), `non-preemptive`, `fails N,N` (the numbers of the failing calls, from 0),
/// `restarts` or `falls-back` (the remedy after a fault), `updates STATE`, `reads STATE`,
/// `samples NAME` (a subtask of another DAG), and with the numbers of the acting calls
/// `raises DAG N,N`, `pauses DAG N,N` and then `resumes DAG N,N`, `enters MODE N` or
/// `enters-idle MODE N`, `ends-run N`.
///
/// A waiting subtask has for each wait `wait LIMIT then TIMES`, or
/// `wait LIMIT answered TIMES then TIMES`. With `answered` the subtask asks a device, which answers
/// after the first times; without, it sleeps until the limit. Then the subtask executes for the
/// last times. In real time no device answers.
///
/// `TIMES` are the execution times of the first calls, separated by `/`; all later calls take the
/// last time.
#[derive(Clone, Debug, Default)]
pub struct SubtaskText {
    pub(crate) name: String,
    pub(crate) takes: Vec<Duration>,
    /// The waits.
    pub waits: Vec<WaitText>,
    pub(crate) after: Vec<String>,
    /// The priority, if the DAG's deadline does not give it.
    pub priority: Option<u32>,
    /// The longest execution time.
    pub wcet: Option<Duration>,
    /// The most time a call may compute.
    pub budget: Option<Duration>,
    pub(crate) due: Option<Duration>,
    pub(crate) is_non_preemptive: bool,
    /// Whether the subtask computes instead of holding its core; a subtask with a budget always
    /// computes.
    pub computes: bool,
    pub(crate) fails: Vec<u64>,
    pub(crate) replaced: Replaced,
    pub(crate) uses: Use,
    /// The numbers of the calls in which the subtask acts.
    pub(crate) when: Vec<u64>,
}

/// A wait of a subtask.
#[derive(Clone, Debug)]
pub struct WaitText {
    pub(crate) limit: Duration,
    /// The times until a device's answers, in the first calls; empty for a sleep.
    pub(crate) answered: Vec<Duration>,
    /// The execution times of the segment behind the wait, in the first calls; below, the longest.
    pub(crate) takes: Vec<Duration>,
    pub(crate) wcet: Option<Duration>,
}

impl WaitText {
    /// Reads `LIMIT then TIMES`, or `LIMIT answered TIMES then TIMES`.
    fn read(words: &mut Words<'_>) -> Result<Self, String> {
        let limit = time(words)?;
        let answered = match words.next_if_eq(&"answered") {
            Some(_) => times(words)?,
            None => vec![],
        };
        match words.next() {
            Some("then") => Ok(Self {
                limit,
                answered,
                takes: times(words)?,
                wcet: None,
            }),
            _ => Err("a wait is `wait LIMIT then TIMES`".into()),
        }
    }
}

/// Returns the time of a call, from the times of the first calls.
pub(crate) fn of_call(times: &[Duration], call: u64) -> Option<Duration> {
    let call = usize::try_from(call).unwrap_or(usize::MAX);
    times.get(call).or(times.last()).copied()
}

/// The successor of a failed function.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Replaced {
    /// No function: the DAG ends.
    #[default]
    Never,
    /// The same function, made anew.
    Anew,
    /// Another function.
    ByFallback,
}

/// The use of a subtask besides its inputs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) enum Use {
    #[default]
    Nothing,
    Updates(String),
    Reads(String),
    Samples(String),
    Raises(String),
    /// A DAG, and the numbers of the calls resuming the DAG.
    Switches(String, Vec<u64>),
    Enters(String),
    EntersIdle(String),
    EndsRun,
}

/// The words of a line, from left to right.
type Words<'a> = core::iter::Peekable<core::str::SplitWhitespace<'a>>;

fn value<'a>(words: &mut Words<'a>) -> Result<&'a str, String> {
    words.next().ok_or_else(|| "a value is missing".into())
}

fn time(words: &mut Words<'_>) -> Result<Duration, String> {
    Ok(Duration::from_millis(number(value(words)?)?))
}

fn numbers<N: core::str::FromStr>(words: &mut Words<'_>) -> Result<Vec<N>, String> {
    value(words)?.split([',', '/']).map(number).collect()
}

fn times(words: &mut Words<'_>) -> Result<Vec<Duration>, String> {
    let numbers: Vec<u64> = numbers(words)?;
    Ok(numbers.into_iter().map(Duration::from_millis).collect())
}

impl DagText {
    pub(crate) fn read(line: &str) -> Result<Self, String> {
        let mut words = line.split_whitespace().peekable();
        let mut dag = Self {
            name: value(&mut words)?.into(),
            jobs: 1,
            ..Self::default()
        };
        while let Some(key) = words.next() {
            let words = &mut words;
            match key {
                "period" => dag.period = time(words)?,
                "sporadic" => (dag.is_sporadic, dag.period) = (true, time(words)?),
                "deadline" => dag.deadline = Some(time(words)?),
                "offset" => dag.offset = time(words)?,
                "jobs" => dag.jobs = number(value(words)?)?,
                "in-flight" => dag.in_flight = Some(number(value(words)?)?),
                "overrun" => {
                    dag.overrun = match value(words)? {
                        "skip" => OverrunPolicy::Skip,
                        "abort" => OverrunPolicy::Abort,
                        _ => OverrunPolicy::Queue,
                    }
                }
                "survives" => {
                    let limit: Vec<u64> = numbers(words)?;
                    let [faults, window, in_all] = limit[..] else {
                        return Err("`survives` takes FAULTS/WINDOW/ALL".into());
                    };
                    let narrow = |number| u32::try_from(number).unwrap_or(u32::MAX);
                    let limit = FaultLimit::new(narrow(faults), window, narrow(in_all));
                    dag.survives = Some(limit);
                }
                "cluster" => dag.cluster = Some(number(value(words)?)?),
                "affinity" => dag.affinity = numbers(words)?,
                "paused" => dag.is_paused = true,
                "on-fault" => dag.on_fault = Some(value(words)?.into()),
                _ => return Err(format!("`{key}` is no word of a dag")),
            }
        }
        Ok(dag)
    }

    pub(crate) fn take_subtask(&mut self, line: &str) -> Result<(), String> {
        let mut words = line.split_whitespace().peekable();
        let mut subtask = SubtaskText {
            name: value(&mut words)?.into(),
            takes: times(&mut words)?,
            ..SubtaskText::default()
        };
        let of_others: Vec<String> = self.subtasks.iter().map(|of| of.name.clone()).collect();
        while let Some(key) = words.next() {
            let words = &mut words;
            let mut acts = |make: fn(String) -> Use| -> Result<(Use, Vec<u64>), String> {
                Ok((make(value(words)?.into()), numbers(words)?))
            };
            match key {
                "raises" => (subtask.uses, subtask.when) = acts(Use::Raises)?,
                "pauses" | "resumes" => {
                    let (name, calls) = (value(words)?.into(), numbers(words)?);
                    let resumes = match key {
                        "pauses" => core::mem::replace(&mut subtask.when, calls),
                        _ => calls,
                    };
                    subtask.uses = Use::Switches(name, resumes);
                }
                "enters-idle" => (subtask.uses, subtask.when) = acts(Use::EntersIdle)?,
                "enters" => (subtask.uses, subtask.when) = acts(Use::Enters)?,
                "ends-run" => (subtask.uses, subtask.when) = (Use::EndsRun, numbers(words)?),
                "updates" => subtask.uses = Use::Updates(value(words)?.into()),
                "reads" => subtask.uses = Use::Reads(value(words)?.into()),
                "samples" => subtask.uses = Use::Samples(value(words)?.into()),
                "after" => {
                    while let Some(name) =
                        words.next_if(|name| of_others.iter().any(|of| of == name))
                    {
                        subtask.after.push(name.into());
                    }
                    if subtask.after.is_empty() {
                        return Err("`after` names no subtask that stands before".into());
                    }
                }
                "wait" => subtask.waits.push(WaitText::read(words)?),
                "priority" => subtask.priority = Some(number(value(words)?)?),
                "wcet" => subtask.wcet = Some(time(words)?),
                "budget" => subtask.budget = Some(time(words)?),
                "due" => subtask.due = Some(time(words)?),
                "non-preemptive" => subtask.is_non_preemptive = true,
                "fails" => subtask.fails = numbers(words)?,
                "restarts" => subtask.replaced = Replaced::Anew,
                "falls-back" => subtask.replaced = Replaced::ByFallback,
                _ => return Err(format!("`{key}` is no word of a subtask")),
            }
        }
        self.subtasks.push(subtask);
        Ok(())
    }

    /// Returns a subtask's number of predecessors, and whether it has successors.
    pub(crate) fn shape(&self, subtask: &SubtaskText) -> (usize, bool) {
        let mut all = self.subtasks.iter();
        let is_read = all.any(|other| other.after.contains(&subtask.name));
        (subtask.after.len(), is_read)
    }

    /// Returns the sampled subtasks of other DAGs.
    pub(crate) fn samples(&self) -> Vec<&str> {
        let mut names = vec![];
        for subtask in &self.subtasks {
            if let Use::Samples(name) = &subtask.uses {
                names.push(name.as_str());
            }
        }
        names
    }
}
