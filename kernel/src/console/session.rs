//! The conversation with a person during a run.
//!
//! It takes place in core 0's background, so it never keeps an instance waiting,
//! but for a few microseconds of the scheduler's lock; and it gets only the time
//! that core 0 has left. It hears at most [`PERIOD_NS`] late, as far as core 0 is
//! idle then. Nothing is allocated.
//!
//! Each command is answered by lines for people and by one machine line of kind
//! `console`; `dags` and `stats` print a line of kind `dag_status` for each DAG.

use core::fmt::Display;

use sched_dag::{Dag, DagId, TaskSet};

use super::command::{Command, HELP, parse};
use super::input::{Input, Typed};
use super::send_pending_byte;
use crate::execution::{self, Control, Snapshot, State};
use crate::machine::serial;
use crate::{json, println, trace};

/// How often core 0 looks for bytes while it is idle.
pub(crate) const PERIOD_NS: u64 = 20_000_000;

/// The most bytes that are taken at a time: the port may not end to have some.
const MOST_BYTES: usize = 256;

/// A conversation.
#[derive(Debug)]
pub(crate) struct Session {
    input: Input,
    echoes: bool,
    is_shutting_down: bool,
}

impl Session {
    /// Begins a conversation; `echoes`: what is typed is sent back.
    pub(crate) const fn new(echoes: bool) -> Self {
        Self {
            input: Input::new(),
            echoes,
            is_shutting_down: false,
        }
    }

    /// Reports whether a person has asked for the run to end.
    pub(crate) const fn is_shutting_down(&self) -> bool {
        self.is_shutting_down
    }

    /// Takes what was typed and answers it.
    pub(crate) fn step(&mut self) {
        let Some(task_set) = execution::task_set() else {
            return;
        };
        for _ in 0..MOST_BYTES {
            let Some(byte) = serial::receive() else {
                break;
            };
            if self.echoes {
                crate::print!("{}", char::from(if byte == b'\r' { b'\n' } else { byte }));
            }
            match self.input.take(byte) {
                Typed::Nothing => continue,
                Typed::Line(line) => {
                    if answer(line, &task_set) == Command::Shutdown {
                        self.is_shutting_down = true;
                    }
                }
                Typed::TooLong => refuse("", &"the line is too long; no command is"),
                Typed::NotText => refuse("", &"the line is not UTF-8"),
            }
            flush();
        }
        if self.is_shutting_down {
            end_what_is_idle(&task_set);
        }
    }
}

/// Answers a line and returns its command; if it is none, [`Command::Help`].
fn answer<'l>(line: &'l str, task_set: &TaskSet) -> Command<'l> {
    let command = match parse(line) {
        Ok(command) => command,
        Err(refusal) => {
            refuse(line, &refusal);
            return Command::Help;
        }
    };
    match command {
        Command::Help => {
            for (command, what) in HELP {
                println!("  {command:14}{what}");
            }
            accept(line);
        }
        Command::Dags => list(line, task_set, None, describe),
        Command::Stats(name) => list(line, task_set, name, count),
        Command::Trace(true) if !trace::has_room() => {
            refuse(
                line,
                &"there is no room for events; boot with `trace_events=4096`",
            );
        }
        Command::Trace(on) => {
            trace::record_events(on);
            println!(
                "{}",
                if on {
                    "events are recorded"
                } else {
                    "no events are recorded"
                }
            );
            accept(line);
        }
        Command::Stop(name) => change(
            line,
            task_set,
            name,
            Control::Pause,
            "releases no more jobs",
        ),
        Command::Start(name) => change(line, task_set, name, Control::Resume, "releases jobs"),
        Command::Shutdown => {
            println!("shutting down: nothing more is released; what is in flight goes on");
            ids(task_set).for_each(|dag| execution::control(Control::Pause(dag)));
            accept(line);
        }
    }
    command
}

/// Ends each DAG that has nothing in flight; when all are, the run is over.
fn end_what_is_idle(task_set: &TaskSet) {
    for dag in ids(task_set) {
        let snapshot = execution::snapshot(dag);
        let is_idle = |of: &Snapshot| of.in_flight == 0 && of.state != State::Ended;
        if snapshot.as_ref().is_some_and(is_idle) {
            execution::control(Control::End(dag));
        }
    }
}

/// Prints a line of each DAG, or of the one that is named.
fn list(line: &str, task_set: &TaskSet, name: Option<&str>, print: fn(&Dag, &Snapshot)) {
    let chosen = match name.map(|name| find(task_set, name)) {
        None => None,
        Some(Some(dag)) => Some(dag),
        Some(None) => return unknown(line, name.unwrap_or_default()),
    };
    for dag in ids(task_set).filter(|dag| chosen.is_none_or(|chosen| chosen == *dag)) {
        if let Some(snapshot) = execution::snapshot(dag) {
            crate::print!("  dag {} ", dag.0);
            print(task_set.dag(dag), &snapshot);
            emit(dag, task_set.dag(dag).name(), &snapshot);
            flush();
        }
    }
    accept(line);
}

fn describe(dag: &Dag, snapshot: &Snapshot) {
    println!(
        "`{}`: {}; {} subtasks, {} T = {} us, D = {} us",
        dag.name(),
        word(snapshot.state),
        dag.subtasks().len(),
        if dag.is_sporadic() { "sporadic," } else { "" },
        dag.period_ns() / 1000,
        dag.relative_deadline_ns() / 1000
    );
}

fn count(dag: &Dag, snapshot: &Snapshot) {
    let Snapshot {
        state,
        statistics,
        in_flight,
        waiting,
    } = snapshot;
    println!(
        "`{}`: {}; {} jobs released, {} completed, {in_flight} in flight, {waiting} waiting; \
         {} deadlines missed, {} jobs skipped, {} aborted",
        dag.name(),
        word(*state),
        statistics.released,
        statistics.completed,
        statistics.misses,
        statistics.skips,
        statistics.aborts
    );
}

/// Prints the machine line of a DAG.
pub(crate) fn emit(dag: DagId, name: &str, snapshot: &Snapshot) {
    let of = snapshot.statistics;
    json::emit("dag_status", |line| {
        line.number("dag", dag.0)
            .text("name", name)
            .text("state", word(snapshot.state))
            .number("released", of.released)
            .number("completed", of.completed)
            .number("in_flight", snapshot.in_flight)
            .number("waiting", snapshot.waiting)
            .number("misses", of.misses)
            .number("skips", of.skips)
            .number("aborts", of.aborts)
            .number("faults", of.faults);
    });
}

const fn word(state: State) -> &'static str {
    match state {
        State::Running => "running",
        State::Paused => "stopped",
        State::Ended => "ended",
        State::Over => "over",
    }
}

/// Makes a change to the DAG that is named.
fn change(line: &str, task_set: &TaskSet, name: &str, how: fn(DagId) -> Control, what: &str) {
    let Some(dag) = find(task_set, name) else {
        return unknown(line, name);
    };
    let state = execution::snapshot(dag).map(|snapshot| snapshot.state);
    if let Some(State::Ended | State::Over) = state {
        let of = task_set.dag(dag).name();
        return refuse(line, &format_args!("dag `{of}` has ended and stays so"));
    }
    execution::control(how(dag));
    println!("dag `{}` {what}", task_set.dag(dag).name());
    accept(line);
}

/// Finds a DAG by its name or, if none has it, by its number.
fn find(task_set: &TaskSet, name: &str) -> Option<DagId> {
    let by_name = ids(task_set).find(|dag| task_set.dag(*dag).name() == name);
    by_name.or_else(|| ids(task_set).find(|dag| name.parse() == Ok(dag.0)))
}

fn ids(task_set: &TaskSet) -> impl Iterator<Item = DagId> {
    (0..).map(DagId).take(task_set.dags().len())
}

fn unknown(line: &str, name: &str) {
    refuse(
        line,
        &format_args!("there is no dag `{name}`; `dags` lists them"),
    );
}

fn accept(line: &str) {
    json::emit("console", |object| {
        object.text("command", line).flag("accepted", true);
    });
}

fn refuse(line: &str, why: &dyn Display) {
    println!("{why}");
    json::emit("console", |object| {
        object
            .text("command", line)
            .flag("accepted", false)
            .text("reason", why);
    });
}

/// Sends all that waits: more than the buffer holds may be said.
fn flush() {
    while send_pending_byte() {}
}
