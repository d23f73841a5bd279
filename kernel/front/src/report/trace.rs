//! The trace as machine lines; `docs/trace-format.md` has the format.

use core::fmt;

use sched_dag::journal::Event;
use sched_dag::{Dag, SubtaskId};

use crate::text::{graph, json};
use sched_dag::engine::Run;

/// The most events on one line.
const EVENTS_A_LINE: usize = 32;

/// Prints the model and the events of a run, the `number`th since boot.
pub fn dump(run: &Run, number: u64) {
    json::emit("trace_begin", |line| {
        graph::scheduling(line, &run.options(), run.task_set());
        line.number("run", number);
    });
    for (number, dag) in (0u32..).zip(run.task_set().dags()) {
        dump_dag(number, dag);
    }
    let journal = run.journal();
    let mut events = journal.events().peekable();
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
    json::emit("trace_end", |line| {
        line.number("events", journal.events().count() as u64)
            .number("lost", journal.lost())
            // A run ends when all its jobs have: nothing is still to come.
            .flag("complete", true);
    });
}

fn as_json(event: Event) -> impl fmt::Display {
    fmt::from_fn(move |f| {
        let Event {
            time_ns,
            what,
            core,
            dag,
            job,
            subtask,
        } = event;
        write!(f, "[{time_ns},\"{what}\",{},{},{job},", core.0, dag.0)?;
        match subtask {
            Some(SubtaskId(subtask)) => write!(f, "{subtask}]"),
            None => f.write_str("-1]"),
        }
    })
}

fn dump_dag(number: u32, dag: &Dag) {
    json::emit("trace_dag", |line| {
        graph::describe(line, number, dag);
        if dag.is_sporadic() {
            line.flag("sporadic", true);
        }
    });
}
