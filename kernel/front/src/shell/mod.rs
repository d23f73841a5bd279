//! The shell: the conversation with a person during a run, on every platform.
//!
//! The shell works in slices of a few microseconds each, whenever the platform has time for a
//! slice, and so keeps no instance waiting. Nothing is allocated. (Only a shutdown takes longer: a
//! step of the scheduler for each DAG.) The shell queries the run through a [`LiveRun`]. Some
//! commands exist only if the app has asked for them. They are reached through [`Commands`], so
//! that the images of other apps contain no code for them.
//!
//! Each command is answered by lines for people and by a single machine line of kind `console`;
//! `dags` and `stats` print a line of kind `dag_status` for each DAG.

mod input;
pub mod parameters;
pub mod topics;

use alloc::sync::Arc;
use core::fmt::{self, Display};
use core::marker::PhantomData;
use core::sync::atomic::{AtomicBool, Ordering};

use fass::edge::WatchedValue;
use fass::platform::{self, SetOnce};
use sched_dag::journal::Event;
use sched_dag::lifecycle::Request;
use sched_dag::{Dag, DagId, DagSnapshot, SchedulerQuery, TaskSet};

use crate::options::whole_number;
use crate::text::json;
use crate::{println, report};
use input::{LineEditor, TypedByte};

/// The longest time between two looks of a platform at the incoming bytes.
pub const PERIOD_NS: u64 = 20_000_000;

/// The byte that ends a run in order: ctrl-C on a serial line (ETX in ASCII).
pub const END: u8 = 3;

/// The most bytes taken in a slice: the size of a serial port's FIFO.
const MOST_BYTES: usize = 16;

/// The commands, described for people: the syntax, and the effect of each.
const HELP: [(&str, &str); 8] = [
    ("help", "list the commands"),
    ("dags", "list the DAGs"),
    ("stats [DAG]", "show the counts of a DAG, or of all"),
    (
        "pause DAG",
        "release no more jobs of it; those in flight finish",
    ),
    (
        "resume DAG",
        "release its jobs again, from the next one due",
    ),
    ("trace off", "forget the events so far and record no more"),
    ("trace on", "record events from now on"),
    (
        "shutdown",
        "release nothing more, wait for what is in flight, and end",
    ),
];

/// A platform's services for the shell, about the run going on.
pub trait LiveRun {
    /// Returns the model of the run, if a run goes on.
    fn task_set() -> Option<Arc<TaskSet>>;

    /// Makes a change to a DAG.
    fn control(dag: DagId, change: fn(DagId) -> Request);

    /// Returns the time, in nanoseconds. This is not the time seen by the app's functions
    /// ([`fass::now_ns`]): each reading of that clock may be recorded, and the shell reads the time
    /// in the middle of a function.
    fn now_ns() -> u64;

    /// Asks the scheduler of a cluster a question, if a run goes on.
    fn ask(cluster: usize, query: SchedulerQuery<'_>) -> Option<u64>;

    /// Takes a byte typed by a person.
    fn receive() -> Option<u8>;

    /// Keeps the values of a topic for display, or of no topic; reports whether the topic is
    /// recorded.
    fn watch(topic: Option<&str>) -> bool {
        platform::watch(topic)
    }

    /// Takes the latest value kept for display, if there is a new value.
    fn take_seen(into: &mut [u8]) -> Option<WatchedValue> {
        platform::take_seen(into)
    }
}

/// Returns the state and the counts of a DAG, if a run goes on.
pub fn snapshot<R: LiveRun>(task_set: &TaskSet, dag: DagId) -> Option<DagSnapshot> {
    let cluster = task_set.dag(dag).cluster().index();
    let mut found = None;
    R::ask(cluster, SchedulerQuery::Dag(dag, &mut found));
    found
}

/// Calls `take` with the latest events in the journal of a cluster, from the latest one backwards:
/// at most `most` events, rounded up to a multiple of 64, and until `take` returns false.
pub fn look_back<R: LiveRun>(cluster: usize, most: u64, take: &mut dyn FnMut(&Event) -> bool) {
    /// The number of events copied at a time under the lock.
    const AT_ONCE: usize = 64;
    let mut end = R::ask(cluster, SchedulerQuery::Written).unwrap_or(0);
    let last = end.saturating_sub(most);
    while end > last {
        let mut buffer = [None; AT_ONCE];
        let copied = R::ask(cluster, SchedulerQuery::Events(end, &mut buffer));
        if !buffer.iter().flatten().all(&mut *take) {
            return;
        }
        match copied {
            Some(oldest) if oldest < end => end = oldest,
            _ => break,
        }
    }
}

/// A function by which a command explains why it does not do as asked.
pub type Refuse<'r> = &'r mut dyn FnMut(&dyn Display);

/// The commands about parameters, if the app has asked for them.
pub(crate) static PARAMETERS: SetOnce<&'static dyn Commands> = SetOnce::new();

/// The commands about topics, if the app has asked for them.
pub(crate) static TOPICS: SetOnce<&'static dyn Commands> = SetOnce::new();

/// Returns the commands requested by the app.
fn extra() -> impl Iterator<Item = &'static dyn Commands> {
    [&PARAMETERS, &TOPICS]
        .into_iter()
        .filter_map(|commands| commands.get().copied())
}

/// Whether a person has ended the run.
pub static IS_SHUT_DOWN: AtomicBool = AtomicBool::new(false);

/// Stops all releases, and lets the jobs in flight go on to their end.
pub fn shut_down<R: LiveRun>() {
    let Some(task_set) = R::task_set() else {
        return;
    };
    println!("shutting down: nothing more is released; what is in flight goes on");
    IS_SHUT_DOWN.store(true, Ordering::Relaxed);
    let dags = (0..).map(DagId).take(task_set.dags().len());
    dags.for_each(|dag| R::control(dag, Request::Close));
}

/// A group of commands of the shell.
pub trait Commands: Sync {
    /// Describes the commands for people: the syntax, and the effect of each.
    fn help(&self) -> &'static [(&'static str, &'static str)];

    /// Executes the command `name` with the arguments `rest`, or explains why not. Returns `false`
    /// if the command is not in this group. Allocates nothing.
    fn answer(&self, name: &str, rest: &str, refuse: Refuse<'_>) -> bool;

    /// Continues a lengthy command for a moment.
    fn step(&self) {}
}

/// A conversation with a person.
pub struct ShellSession<R> {
    input: LineEditor,
    echoes: bool,
    listing: Option<DagListing>,
    run: PhantomData<fn() -> R>,
}

/// The DAGs still to be listed, each in a slice of its own.
#[derive(Clone, Copy, Debug)]
struct DagListing {
    next: DagId,
    /// The first DAG after the list.
    end: DagId,
    print: fn(&DagSnapshot, &Dag),
}

impl<R: LiveRun> ShellSession<R> {
    /// Begins a conversation; with `echoes`, typed bytes are sent back.
    pub const fn new(echoes: bool) -> Self {
        Self {
            input: LineEditor::new(),
            echoes,
            listing: None,
            run: PhantomData,
        }
    }

    /// Does a little work: prints the line of a single DAG, or takes a few bytes and answers a line
    /// completed by them. Reports whether there is more to do at once.
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
        extra().for_each(Commands::step);
        for _ in 0..MOST_BYTES {
            let Some(byte) = R::receive() else {
                return false;
            };
            if byte == END {
                shut_down::<R>();
                break;
            }
            if self.echoes {
                crate::print!("{}", char::from(if byte == b'\r' { b'\n' } else { byte }));
            }
            match self.input.on_byte(byte) {
                TypedByte::Nothing => continue,
                TypedByte::Line(line) => {
                    let mut is_refused = false;
                    self.listing = answer::<R>(line, &task_set, &mut |why| {
                        is_refused = true;
                        refuse(line, why);
                    });
                    if !is_refused && self.listing.is_none() {
                        accept(line);
                    }
                }
                TypedByte::TooLong => refuse("", &"the line is too long: no command is as long"),
                TypedByte::NotText => refuse("", &"the line is not UTF-8"),
            }
            break;
        }
        true
    }
}

impl DagListing {
    /// Prints the next DAG's lines and returns the rest of the list.
    fn print_one<R: LiveRun>(self, task_set: &TaskSet) -> Option<DagListing> {
        let (dag, model) = (self.next, task_set.dag(self.next));
        if let Some(snapshot) = snapshot::<R>(task_set, dag) {
            report::show_dag(&snapshot, dag, model, self.print);
        }
        let next = DagId(dag.0 + 1);
        (next < self.end).then_some(DagListing { next, ..self })
    }
}

/// Executes a line, or explains why not. Returns the DAGs to be listed in answer.
fn answer<R: LiveRun>(line: &str, task_set: &TaskSet, refuse: Refuse<'_>) -> Option<DagListing> {
    let (name, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    let rest = rest.trim();
    let wants = |what: &str, refuse: Refuse<'_>| refuse(&format_args!("`{name}` wants {what}"));
    match (name, rest) {
        ("help", "") => {
            for (command, what) in HELP.iter().chain(extra().flat_map(Commands::help)) {
                println!("  {command:15}{what}");
            }
        }
        ("dags", "") => return list(task_set, rest, describe, refuse),
        ("stats", _) => return list(task_set, rest, report::print_counts, refuse),
        ("trace", "on" | "off") => record::<R>(rest == "on", task_set, refuse),
        ("pause" | "resume", "") => {
            wants("the name or the number of a DAG; `dags` lists them", refuse)
        }
        ("pause" | "resume", _) if task_set.certificate().is_some() => refuse(
            &"a certificate fixes the set, whose bounds a pause would void; run it without one",
        ),
        ("pause", dag) => {
            let what = "releases no more jobs";
            change::<R>(task_set, dag, Request::Pause, what, refuse);
        }
        ("resume", dag) => change::<R>(task_set, dag, Request::Resume, "releases jobs", refuse),
        ("shutdown", "") => shut_down::<R>(),
        ("help" | "dags" | "shutdown", _) => wants("nothing after it", refuse),
        ("trace", _) => wants("`on` or `off`", refuse),
        _ => {
            if !extra().any(|commands| commands.answer(name, rest, refuse)) {
                refuse(&no_command(name, extra));
            }
        }
    }
    None
}

/// Says that a word is no command, and lists all commands.
fn no_command<E: Iterator<Item = &'static dyn Commands>>(
    name: &str,
    extra: impl Fn() -> E,
) -> impl Display {
    fmt::from_fn(move |f| {
        write!(f, "`{name}` is no command; there are ")?;
        let all = HELP.iter().chain(extra().flat_map(Commands::help));
        for (index, (command, _)) in all.enumerate() {
            let separator = if index == 0 { "" } else { ", " };
            write!(f, "{separator}{command}")?;
        }
        Ok(())
    })
}

/// Starts recording events, or stops and forgets them.
fn record<R: LiveRun>(on: bool, task_set: &TaskSet, refuse: Refuse<'_>) {
    if on && R::ask(0, SchedulerQuery::HasRoom) != Some(1) {
        return refuse(&"there is no room for events; boot without `trace_events=0`");
    }
    for cluster in task_set.clusters() {
        R::ask(cluster.index(), SchedulerQuery::Record(on));
    }
    let what = if on { "events" } else { "no events" };
    println!("{what} are recorded");
}

/// Begins a list of the named DAG, or of all DAGs.
fn list(
    task_set: &TaskSet,
    name: &str,
    print: fn(&DagSnapshot, &Dag),
    refuse: Refuse<'_>,
) -> Option<DagListing> {
    let all = u32::try_from(task_set.dags().len()).unwrap_or(u32::MAX);
    let (next, end) = match name {
        "" => (DagId(0), DagId(all)),
        name => {
            let dag = find(task_set, name, refuse)?;
            (dag, DagId(dag.0 + 1))
        }
    };
    Some(DagListing { next, end, print })
}

fn describe(snapshot: &DagSnapshot, dag: &Dag) {
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

/// Makes a change to the named DAG.
fn change<R: LiveRun>(
    task_set: &TaskSet,
    name: &str,
    how: fn(DagId) -> Request,
    what: &str,
    refuse: Refuse<'_>,
) {
    let Some(dag) = find(task_set, name, refuse) else {
        return;
    };
    let of = task_set.dag(dag).name();
    if snapshot::<R>(task_set, dag).is_some_and(|snapshot| snapshot.is_final()) {
        return refuse(&format_args!("dag `{of}` has ended and stays so"));
    }
    R::control(dag, how);
    println!("dag `{of}` {what}");
}

/// Finds a DAG by its name or, if no DAG has the name, by its number.
fn find(task_set: &TaskSet, name: &str, refuse: Refuse<'_>) -> Option<DagId> {
    let ids = || (0..).map(DagId).take(task_set.dags().len());
    let by_name = ids().find(|dag| task_set.dag(*dag).name() == name);
    let number = whole_number(name);
    let found = by_name.or_else(|| ids().find(|dag| number == Some(u64::from(dag.0))));
    if found.is_none() {
        refuse(&format_args!("there is no dag `{name}`; `dags` lists them"));
    }
    found
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
