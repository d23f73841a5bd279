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

use sched_dag::lifecycle::Request;
use sched_dag::{Dag, DagId, Snapshot, TaskSet};

use super::command::{Command, HELP, parse};
use super::input::{Input, Typed};
use super::{more, stop};
use crate::println;
use crate::report::counts::Counts;
use executive::machine::serial;
use executive::run::execution;
use front::json;
use front::options::whole_number;

/// How often core 0 looks for bytes, at least.
pub(crate) const PERIOD_NS: u64 = 20_000_000;

/// The most bytes that a slice takes: what the port's FIFO holds.
const MOST_BYTES: usize = 16;

/// A conversation.
#[derive(Debug)]
pub(crate) struct Session {
    input: Input,
    echoes: bool,
    listing: Option<Listing>,
}

/// DAGs that are still to be listed, each in a slice of its own.
#[derive(Clone, Copy, Debug)]
struct Listing {
    next: DagId,
    /// The first one that is not to be listed.
    end: DagId,
    print: fn(&Counts, &Dag),
}

impl Session {
    /// Begins a conversation; `echoes`: what is typed is sent back.
    pub(crate) const fn new(echoes: bool) -> Self {
        Self {
            input: Input::new(),
            echoes,
            listing: None,
        }
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
            if byte == stop::BYTE {
                stop::shut_down();
                break;
            }
            if self.echoes {
                crate::print!("{}", char::from(if byte == b'\r' { b'\n' } else { byte }));
            }
            match self.input.take(byte) {
                Typed::Nothing => continue,
                Typed::Line(line) => match answer(line, &task_set) {
                    Answer::Given => {}
                    Answer::List(listing) => self.listing = Some(listing),
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
            counts(&snapshot).show_by(dag, model, self.print);
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
        Command::Stats(name) => return list(line, task_set, name, Counts::print),
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
                Request::Pause,
                "releases no more jobs",
            );
        }
        Command::Start(name) => change(line, task_set, name, Request::Resume, "releases jobs"),
        Command::Shutdown => {
            stop::shut_down();
            accept(line);
        }
    }
    Answer::Given
}

/// Begins a list of all DAGs, or of the one that is named.
fn list(line: &str, task_set: &TaskSet, name: Option<&str>, print: fn(&Counts, &Dag)) -> Answer {
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

fn describe(counts: &Counts, dag: &Dag) {
    println!(
        "`{}`: {}; {} subtasks, {}T = {} us, D = {} us",
        dag.name(),
        counts.state,
        dag.subtasks().len(),
        if dag.is_sporadic() { "sporadic, " } else { "" },
        dag.period_ns() / 1000,
        dag.relative_deadline_ns() / 1000
    );
}

/// Returns what is told of a DAG that does so.
pub(crate) const fn counts(snapshot: &Snapshot) -> Counts {
    Counts {
        state: snapshot.word(),
        statistics: snapshot.statistics,
        in_flight: snapshot.in_flight,
        waiting: snapshot.waiting,
    }
}

/// Makes a change to the DAG that is named.
fn change(line: &str, task_set: &TaskSet, name: &str, how: fn(DagId) -> Request, what: &str) {
    let Some(dag) = find(task_set, name) else {
        return unknown(line, name);
    };
    if execution::snapshot(dag).is_some_and(|snapshot| snapshot.is_final()) {
        let of = task_set.dag(dag).name();
        return refuse(line, &format_args!("dag `{of}` has ended and stays so"));
    }
    execution::control(dag, how);
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
