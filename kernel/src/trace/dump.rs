//! The trace as machine lines; `docs/trace-format.md` has the format.

use core::fmt;

use sched_dag::{Dag, DagId, SubtaskId};

use super::ring::Ring;
use super::{Event, WORDS, all_rings};
use crate::machine::this_core;
use crate::platform::KERNEL;
use crate::run::Run;
use crate::{graph, json};
use fass::{Platform, Policy, Preemption};

/// The most events on one line.
const EVENTS_A_LINE: usize = 32;

/// Prints the model and the events of a run, the `number`th since boot.
pub(crate) fn dump(run: &Run, number: u64) {
    json::emit("trace_begin", |line| {
        let policy = match KERNEL.policy() {
            Policy::StaticPriority => "static",
            Policy::Edf => "edf",
        };
        let preemption = match KERNEL.preemption() {
            Preemption::Enabled => "on",
            Preemption::Disabled => "off",
        };
        line.text("policy", policy)
            .text("preemption", preemption)
            .number("cores", KERNEL.cores())
            .number("run", number);
    });
    for (number, dag) in (0u32..).zip(run.task_set().dags()) {
        dump_dag(number, dag, run);
    }
    for ring in all_rings() {
        let mut events = ring.iter().peekable();
        while events.peek().is_some() {
            let mut batch = [None; EVENTS_A_LINE];
            for (place, event) in batch.iter_mut().zip(&mut events) {
                *place = Some(event);
            }
            json::emit("trace", |line| {
                line.list(
                    "events",
                    batch.iter().flatten().map(|event| as_json(*event)),
                );
            });
        }
    }
    let kept = all_rings().iter().map(|ring| ring.iter().count() as u64);
    json::emit("trace_end", |line| {
        line.number("events", kept.clone().sum::<u64>())
            .number("lost", all_rings().iter().map(Ring::lost).sum::<u64>())
            .list("lost_by_core", all_rings().iter().map(Ring::lost))
            // A run ends when all its jobs have: nothing is still to come.
            .flag("complete", true);
    });
}

/// Returns this core's latest `most` events, a line each.
pub(crate) fn latest(most: usize) -> impl fmt::Display {
    fmt::from_fn(move |f| {
        let here = this_core::get().index as usize;
        let Some(ring) = all_rings().get(here) else {
            return Ok(());
        };
        let count = ring.iter().count();
        ring.iter()
            .skip(count.saturating_sub(most))
            .try_for_each(|event| {
                let Event {
                    time_ns,
                    what,
                    core,
                    subject,
                } = event;
                let (word, core) = (WORDS[what as usize], core.0);
                let (dag, job) = (subject.dag().0, subject.job);
                write!(
                    f,
                    "  {time_ns:>12} ns  core {core} {word} dag {dag} job {job}"
                )?;
                let subtask = subject.subtask();
                subtask.map_or(Ok(()), |subtask| write!(f, " subtask {}", subtask.0))?;
                writeln!(f)
            })
    })
}

fn as_json(event: Event) -> impl fmt::Display {
    fmt::from_fn(move |f| {
        let Event {
            time_ns,
            what,
            core,
            subject,
        } = event;
        let (word, core) = (WORDS[what as usize], core.0);
        let (dag, job) = (subject.dag().0, subject.job);
        write!(f, "[{time_ns},\"{word}\",{core},{dag},{job},")?;
        match subject.subtask() {
            Some(SubtaskId(subtask)) => write!(f, "{subtask}]"),
            None => f.write_str("-1]"),
        }
    })
}

fn dump_dag(number: u32, dag: &Dag, run: &Run) {
    json::emit("trace_dag", |line| {
        graph::describe(line, number, dag);
        if dag.is_sporadic() {
            // There is no grid that says when jobs were due.
            let jobs = (0u64..).zip(run.record().jobs(DagId(number)));
            let releases = jobs.filter_map(|(job, of)| Some((job, of.release_ns?)));
            line.flag("sporadic", true).list(
                "releases",
                releases.map(|(job, ns)| fmt::from_fn(move |f| write!(f, "[{job},{ns}]"))),
            );
        }
    });
}
