//! The conversation with a person during a run.
//!
//! It goes on in slices, each of a few microseconds, in core 0's background, so that
//! it keeps no instance waiting; or in its heartbeat, if the background does not come
//! to run. Nothing is allocated. (Only a shutdown takes longer: a step of the
//! scheduler for each DAG.)
//!
//! Each command is answered by lines for people and by one machine line of kind
//! `console`; `dags` and `stats` print a line of kind `dag_status` for each DAG.

use core::fmt::Display;

use sched_dag::{Dag, DagId, TaskSet};

use super::command::{Command, HELP, parse};
use super::input::{Input, Typed};
use super::more;
use crate::options::whole_number;
use crate::println;
use executive::machine::serial;
use executive::run::execution::{self, Control, Snapshot, State};
use executive::text::json;

/// How often core 0 looks for bytes, at least.
pub(crate) const PERIOD_NS: u64 = 20_000_000;

/// The most bytes that a slice takes: what the port's FIFO holds.
const MOST_BYTES: usize = 16;

/// A conversation.
#[derive(Debug)]
pub(crate) struct Session {
    input: Input,
    echoes: bool,
    is_shutting_down: bool,
    listing: Option<Listing>,
}

/// DAGs that are still to be listed, each in a slice of its own.
#[derive(Clone, Copy, Debug)]
struct Listing {
    next: DagId,
    /// The first one that is not to be listed.
    end: DagId,
    print: fn(&Dag, &Snapshot),
}

impl Session {
    /// Begins a conversation; `echoes`: what is typed is sent back.
    pub(crate) const fn new(echoes: bool) -> Self {
        Self {
            input: Input::new(),
            echoes,
            is_shutting_down: false,
            listing: None,
        }
    }

    /// Reports whether a person has asked for the run to end.
    pub(crate) const fn is_shutting_down(&self) -> bool {
        self.is_shutting_down
    }

    /// Does a little: prints one DAG's line, or takes a few bytes and answers what
    /// they complete. Reports whether there is more to do at once.
    pub(crate) fn slice(&mut self) -> bool {
        let Some(task_set) = execution::task_set() else {
            return false;
        };
        if let Some(listing) = self.listing {
            self.listing = listing.print_one(&task_set);
            if self.listing.is_none() {
                accept(self.input.line());
            }
            return true;
        }
        more::all().for_each(more::Commands::step);
        for _ in 0..MOST_BYTES {
            let Some(byte) = serial::FIRST.receive() else {
                return false;
            };
            if self.echoes {
                crate::print!("{}", char::from(if byte == b'\r' { b'\n' } else { byte }));
            }
            match self.input.take(byte) {
                Typed::Nothing => continue,
                Typed::Line(line) => match answer(line, &task_set) {
                    Answer::Given => {}
                    Answer::List(listing) => self.listing = Some(listing),
                    Answer::ShutsDown => self.is_shutting_down = true,
                },
                Typed::TooLong => refuse("", &"the line is too long: no command is as long"),
                Typed::NotText => refuse("", &"the line is not UTF-8"),
            }
            break;
        }
        true
    }
}

impl Listing {
    /// Prints the next DAG's lines and returns what is left to be listed.
    fn print_one(self, task_set: &TaskSet) -> Option<Listing> {
        let (dag, model) = (self.next, task_set.dag(self.next));
        if let Some(snapshot) = execution::snapshot(dag) {
            show(dag, model, &snapshot, self.print);
        }
        let next = DagId(dag.0 + 1);
        (next < self.end).then_some(Listing { next, ..self })
    }
}

/// What has become of a line.
enum Answer {
    /// It was answered.
    Given,
    /// The DAGs are to be listed.
    List(Listing),
    /// The run shall end.
    ShutsDown,
}

/// Answers a line.
fn answer(line: &str, task_set: &TaskSet) -> Answer {
    let command = match parse(line) {
        Ok(command) => command,
        Err(refusal) => {
            let (name, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
            let mut is_refused = false;
            let refuse = &mut |why: &dyn Display| {
                is_refused = true;
                refuse(line, why);
            };
            if !more::all().any(|commands| commands.answer(name, rest.trim(), refuse)) {
                refuse(&refusal);
            }
            if !is_refused {
                accept(line);
            }
            return Answer::Given;
        }
    };
    match command {
        Command::Help => {
            let more = more::all().flat_map(more::Commands::help);
            for (command, what) in HELP.iter().chain(more) {
                println!("  {command:15}{what}");
            }
            accept(line);
        }
        Command::Dags => return list(line, task_set, None, describe),
        Command::Stats(name) => return list(line, task_set, name, count),
        Command::Trace(true)
            if !execution::with_journal(0, |journal| journal.has_room()).unwrap_or(false) =>
        {
            let why = "there is no room for events; boot without `trace_events=0`";
            refuse(line, &why);
        }
        Command::Trace(on) => {
            for cluster in 0..execution::clusters() {
                execution::with_journal(cluster, |journal| journal.record_events(on));
            }
            let what = if on { "events" } else { "no events" };
            println!("{what} are recorded");
            accept(line);
        }
        Command::Stop(name) => {
            change(
                line,
                task_set,
                name,
                Control::Pause,
                "releases no more jobs",
            );
        }
        Command::Start(name) => change(line, task_set, name, Control::Resume, "releases jobs"),
        Command::Shutdown => {
            println!("shutting down: nothing more is released; what is in flight goes on");
            ids(task_set).for_each(|dag| execution::control(Control::Close(dag)));
            accept(line);
            return Answer::ShutsDown;
        }
    }
    Answer::Given
}

/// Begins a list of all DAGs, or of the one that is named.
fn list(line: &str, task_set: &TaskSet, name: Option<&str>, print: fn(&Dag, &Snapshot)) -> Answer {
    let chosen = match name.map(|name| find(task_set, name).ok_or(name)) {
        None => None,
        Some(Ok(dag)) => Some(dag),
        Some(Err(name)) => {
            unknown(line, name);
            return Answer::Given;
        }
    };
    let all = u32::try_from(task_set.dags().len()).unwrap_or(u32::MAX);
    Answer::List(Listing {
        next: chosen.unwrap_or(DagId(0)),
        end: chosen.map_or(DagId(all), |dag| DagId(dag.0 + 1)),
        print,
    })
}

fn describe(dag: &Dag, snapshot: &Snapshot) {
    println!(
        "`{}`: {}; {} subtasks, {}T = {} us, D = {} us",
        dag.name(),
        word(snapshot.state),
        dag.subtasks().len(),
        if dag.is_sporadic() { "sporadic, " } else { "" },
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
         {} deadlines missed, {} jobs skipped, {} aborted, {} lost to faults",
        dag.name(),
        word(*state),
        statistics.released,
        statistics.completed,
        statistics.misses,
        statistics.skips,
        statistics.aborts,
        statistics.failed
    );
}

/// Prints the lines of a DAG with its counts.
pub(crate) fn show_counts(dag: DagId, model: &Dag, snapshot: &Snapshot) {
    show(dag, model, snapshot, count);
}

/// Prints the line of a DAG for people, of which `print` makes the rest, and its
/// machine line.
fn show(dag: DagId, model: &Dag, snapshot: &Snapshot, print: fn(&Dag, &Snapshot)) {
    crate::print!("  dag {} ", dag.0);
    print(model, snapshot);
    let of = snapshot.statistics;
    json::emit("dag_status", |line| {
        line.number("dag", dag.0)
            .text("name", model.name())
            .text("state", word(snapshot.state))
            .number("released", of.released)
            .number("completed", of.completed)
            .number("in_flight", snapshot.in_flight)
            .number("waiting", snapshot.waiting)
            .number("misses", of.misses)
            .number("skips", of.skips)
            .number("aborts", of.aborts)
            .number("faults", of.faults)
            .number("failed", of.failed)
            .number("restarts", of.restarts);
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
    let number = whole_number(name);
    by_name.or_else(|| ids(task_set).find(|dag| number == Some(u64::from(dag.0))))
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
