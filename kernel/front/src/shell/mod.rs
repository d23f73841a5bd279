//! The shell: the conversation with a person during a run, on whatever platform.
//!
//! It goes on in slices, each of a few microseconds, whenever the platform has time for one, so
//! that it keeps no instance waiting. Nothing is allocated. (Only a shutdown takes longer: a step
//! of the scheduler for each DAG.) What it asks of the run is a [`LiveRun`]. Some commands are there
//! only where the app has called for them: they are reached through [`Commands`], so that another
//! image has no code for them.
//!
//! Each command is answered by lines for people and by one machine line of kind
//! `console`; `dags` and `stats` print a line of kind `dag_status` for each DAG.

mod command;
mod input;
mod parameters;
pub mod topics;

use alloc::sync::Arc;
use core::fmt::Display;
use core::marker::PhantomData;

use fass::edge::Seen;
use sched_dag::lifecycle::Request;
use sched_dag::{Dag, DagId, Journal, Snapshot, TaskSet};

use crate::options::whole_number;
use crate::println;
use crate::report::counts;
use crate::text::json;
use command::{Command, HELP, parse};
use input::{Input, Typed};

/// How often a platform looks for bytes, at least.
pub const PERIOD_NS: u64 = 20_000_000;

/// The byte that ends a run in order: what ctrl-C is on a serial line (ETX in ASCII).
pub const END: u8 = 3;

/// The most bytes that a slice takes: what the FIFO of a serial port holds.
const MOST_BYTES: usize = 16;

/// A run that goes on, as the shell sees it: what a platform has for it.
pub trait LiveRun {
    /// Returns the model of the run, if one goes on.
    fn task_set() -> Option<Arc<TaskSet>>;

    /// Returns how a DAG does, if a run goes on that has it.
    fn snapshot(dag: DagId) -> Option<Snapshot>;

    /// Makes a change to a DAG.
    fn control(dag: DagId, change: fn(DagId) -> Request);

    /// Returns the time, in nanoseconds. Not what functions are told of it ([`fass::now_ns`]): that
    /// may be written down for them, and the shell speaks in the middle of theirs.
    fn now_ns() -> u64;

    /// Returns the number of clusters.
    fn clusters() -> usize;

    /// Looks at the journal of a cluster, shortly, or changes what it records.
    fn with_journal<R>(cluster: usize, look: impl FnOnce(&mut Journal) -> R) -> Option<R>;

    /// Takes a byte that a person has typed.
    fn receive() -> Option<u8>;

    /// Has nothing more released, and what is in flight go on to its end.
    fn shut_down();

    /// Has the values of a topic kept to be seen, or none; reports whether it is recorded.
    fn watch(topic: Option<&str>) -> bool;

    /// Takes the latest value that is to be seen, if there is a new one.
    fn take_seen(into: &mut [u8]) -> Option<Seen>;

    /// Returns the commands that the app has called for.
    fn extra() -> Extra;
}

/// The commands that an app can call for: those about its parameters, and about topics.
pub type Extra = [Option<&'static dyn Commands>; 2];

/// Some commands of the shell.
pub trait Commands: Sync {
    /// Returns them for people: how each is typed, and what it does.
    fn help(&self) -> &'static [(&'static str, &'static str)];

    /// Does what a line says, of its first word and the rest, or tells why not; `false`: it is
    /// none of these commands. Allocates nothing.
    fn answer(&self, name: &str, rest: &str, refuse: &mut dyn FnMut(&dyn Display)) -> bool;

    /// Does a little of what a command has begun.
    fn step(&self) {}
}

/// A conversation.
#[derive(Debug)]
pub struct Session<R> {
    input: Input,
    echoes: bool,
    listing: Option<Listing>,
    run: PhantomData<fn() -> R>,
}

/// DAGs that are still to be listed, each in a slice of its own.
#[derive(Clone, Copy, Debug)]
struct Listing {
    next: DagId,
    /// The first one that is not to be listed.
    end: DagId,
    print: fn(&Snapshot, &Dag),
}

impl<R: LiveRun> Session<R> {
    /// Begins a conversation; `echoes`: what is typed is sent back.
    #[must_use]
    pub const fn new(echoes: bool) -> Self {
        Self {
            input: Input::new(),
            echoes,
            listing: None,
            run: PhantomData,
        }
    }

    /// Does a little: prints one DAG's line, or takes a few bytes and answers what
    /// they complete. Reports whether there is more to do at once.
    pub fn slice(&mut self) -> bool {
        let Some(task_set) = R::task_set() else {
            return false;
        };
        if let Some(listing) = self.listing {
            self.listing = listing.print_one::<R>(&task_set);
            if self.listing.is_none() {
                accept(self.input.line());
            }
            return true;
        }
        R::extra().iter().flatten().for_each(|extra| extra.step());
        for _ in 0..MOST_BYTES {
            let Some(byte) = R::receive() else {
                return false;
            };
            if byte == END {
                R::shut_down();
                break;
            }
            if self.echoes {
                crate::print!("{}", char::from(if byte == b'\r' { b'\n' } else { byte }));
            }
            match self.input.take(byte) {
                Typed::Nothing => continue,
                Typed::Line(line) => match answer::<R>(line, &task_set) {
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
    fn print_one<R: LiveRun>(self, task_set: &TaskSet) -> Option<Listing> {
        let (dag, model) = (self.next, task_set.dag(self.next));
        if let Some(snapshot) = R::snapshot(dag) {
            counts::show(&snapshot, dag, model, self.print);
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
fn answer<R: LiveRun>(line: &str, task_set: &TaskSet) -> Answer {
    let command = match parse(line) {
        Ok(command) => command,
        Err(refusal) => {
            let (name, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
            let mut is_refused = false;
            let refuse = &mut |why: &dyn Display| {
                is_refused = true;
                refuse(line, why);
            };
            let extra = R::extra();
            let mut others = extra.iter().flatten();
            if !others.any(|commands| commands.answer(name, rest.trim(), refuse)) {
                refuse(&refusal.told(extra));
            }
            if !is_refused {
                accept(line);
            }
            return Answer::Given;
        }
    };
    match command {
        Command::Help => {
            let extra = R::extra();
            let extra = extra.iter().flatten().flat_map(|extra| extra.help());
            for (command, what) in HELP.iter().chain(extra) {
                println!("  {command:15}{what}");
            }
            accept(line);
        }
        Command::Dags => return list(line, task_set, None, describe),
        Command::Stats(name) => return list(line, task_set, name, counts::print),
        Command::Trace(true)
            if !R::with_journal(0, |journal| journal.has_room()).unwrap_or(false) =>
        {
            let why = "there is no room for events; boot without `trace_events=0`";
            refuse(line, &why);
        }
        Command::Trace(on) => {
            for cluster in 0..R::clusters() {
                R::with_journal(cluster, |journal| journal.record_events(on));
            }
            let what = if on { "events" } else { "no events" };
            println!("{what} are recorded");
            accept(line);
        }
        Command::Stop(name) => {
            change::<R>(
                line,
                task_set,
                name,
                Request::Pause,
                "releases no more jobs",
            );
        }
        Command::Start(name) => change::<R>(line, task_set, name, Request::Resume, "releases jobs"),
        Command::Shutdown => {
            R::shut_down();
            accept(line);
        }
    }
    Answer::Given
}

/// Begins a list of all DAGs, or of the one that is named.
fn list(line: &str, task_set: &TaskSet, name: Option<&str>, print: fn(&Snapshot, &Dag)) -> Answer {
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

fn describe(snapshot: &Snapshot, dag: &Dag) {
    println!(
        "`{}`: {}; {} subtasks, {}T = {} us, D = {} us",
        dag.name(),
        snapshot.word(),
        dag.subtasks().len(),
        if dag.is_sporadic() { "sporadic, " } else { "" },
        dag.period_ns() / 1000,
        dag.relative_deadline_ns() / 1000
    );
}

/// Makes a change to the DAG that is named.
fn change<R: LiveRun>(
    line: &str,
    task_set: &TaskSet,
    name: &str,
    how: fn(DagId) -> Request,
    what: &str,
) {
    let Some(dag) = find(task_set, name) else {
        return unknown(line, name);
    };
    if R::snapshot(dag).is_some_and(|snapshot| snapshot.is_final()) {
        let of = task_set.dag(dag).name();
        return refuse(line, &format_args!("dag `{of}` has ended and stays so"));
    }
    R::control(dag, how);
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

#[cfg(test)]
mod tests;
