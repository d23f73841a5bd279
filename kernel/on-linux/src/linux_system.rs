//! Linux as the platform below an app's machine: some cores of this computer.
//!
//! During a run people see the log, and with a console a person at standard input can talk with the
//! run.

use std::cell::{Cell, RefCell};
use std::fmt;
use std::fs::{self, File};
use std::io::{self, BufReader, Read, Write};
use std::net::SocketAddrV4;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::sync::{Arc, Barrier, Mutex, OnceLock, PoisonError};
use std::thread;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use fass::platform::{Protocol, RunConfig};
use fass::shared::{Signal, Wire};
use front::app::ending::AppError;
use front::app::endpoint::{EndpointWord, word_of};
use front::app::machine::System;
use front::options::{CommandLine, UsageError};
use front::report::{self, HeapUsage, tell_log};
use front::shell::{END, IS_SHUT_DOWN, LiveRun, PERIOD_NS, ShellSession};
use linux::{Control, EndSignals, Linux, UdpConnection};
use sched_dag::engine::Run;
use sched_dag::lifecycle::Request;
use sched_dag::{DagId, SchedulerQuery, TaskSet};

use crate::heap;

/// The machine, lent to the app's function for the time of the run.
pub type Machine = front::app::machine::Machine<LinuxSystem>;

/// Linux, as seen by an app's machine.
#[derive(Debug)]
pub struct LinuxSystem {
    pub(crate) linux: Linux,
    pub(crate) wires: RefCell<Vec<WireEnds>>,
    /// Protocols with their peers, until the end of a run.
    pub(crate) protocols: RefCell<Vec<(SocketAddrV4, UdpConnection)>>,
    /// The refusal of a request that Linux cannot serve.
    pub(crate) refusal: RefCell<Option<UsageError>>,
    /// The signals that end a run early.
    pub(crate) signals: EndSignals,
    /// Whether a person can talk with a run.
    pub(crate) has_console: bool,
    /// Whether a person has ended the latest run at the console.
    pub(crate) is_closed: Cell<bool>,
}

/// An app's wire, and the ends it is connected to.
#[derive(Clone, Debug)]
pub(crate) struct WireEnds {
    wire: Wire,
    ends: Ends,
}

#[derive(Clone, Copy, Debug)]
enum Ends {
    /// Whether bytes come from standard input, and the output file.
    Bytes(bool, Option<&'static str>),
    /// Datagrams to an own port, from a single peer if one is given.
    Udp(u16, Option<SocketAddrV4>),
}

impl WireEnds {
    /// Connects the ends for a committed run, until the returned value is dropped.
    fn connect(&self, machine: &Linux) -> Result<Box<dyn fmt::Debug>, AppError> {
        let connected: io::Result<Box<dyn fmt::Debug>> = match self.ends {
            Ends::Udp(port, peer) => (machine.connect_udp(&self.wire, port, peer))
                .map(|connection| Box::new(connection) as _),
            Ends::Bytes(is_live, output) => {
                let input: Box<dyn Read + Send> = match is_live {
                    true => Box::new(io::stdin()),
                    false => Box::new(io::empty()),
                };
                let output: Box<dyn Write + Send> = match output {
                    Some(path) => Box::new(
                        File::create(path)
                            .map_err(|why| UsageError::new(format!("`output={path}`: {why}")))?,
                    ),
                    None => Box::new(io::sink()),
                };
                (machine.connect(&self.wire, input, output))
                    .map(|connection| Box::new(connection) as _)
            }
        };
        connected.map_err(|why| AppError::Failure(format!("wire `{}`: {why}", self.wire.name())))
    }
}

impl System for LinuxSystem {
    type Run = LinuxRun;

    fn has_console(&self) -> bool {
        self.has_console
    }

    fn terms(&self) -> RunConfig {
        self.linux.terms()
    }

    fn change(&self, change: impl FnOnce(&mut RunConfig)) {
        self.linux.change(change);
    }

    fn set_coincidence(&self, window: Duration) {
        if window > Duration::ZERO {
            let line = "events are taken together on the machine only; choose a window of 0";
            self.refusal.replace(Some(UsageError::new(line)));
        }
    }

    fn run(&self, epoch_ns: Option<u64>, input: Option<&Signal>) -> Result<Run, AppError> {
        if let Some(refusal) = self.refusal.take() {
            return Err(refusal.into());
        }
        let failure = |why: String| AppError::Failure(why);
        let wires = self.wires.borrow();
        let connected = wires.iter().map(|ends| ends.connect(&self.linux));
        let connected = connected.collect::<Result<Vec<_>, _>>()?;
        // Bytes typed at the console are not events.
        if let Some(signal) = input.filter(|_| !self.has_console) {
            match self.linux.raise_on_input(signal, &io::stdin()) {
                Err(why) if why.kind() == io::ErrorKind::PermissionDenied => front::println!(
                    "note: standard input is a file, in which nothing arrives; it raises no signal"
                ),
                watched => watched
                    .map_err(|why| failure(format!("standard input cannot be watched: {why}")))?,
            }
        }
        if let Some(control) = self.linux.control() {
            let watched = control.close_when_asked(&self.signals);
            watched.map_err(|why| failure(format!("no signal can be waited for: {why}")))?;
        }
        let run = || match epoch_ns {
            Some(epoch_ns) => self.linux.run_from(epoch_ns),
            None => self.linux.run(),
        };
        let (run, is_closed) = talk_during(self.has_console, run);
        self.is_closed.set(is_closed);
        let run = run.map_err(|why| failure(why.to_string()))?;
        drop(connected);
        report::tell_log(|| Some(Arc::clone(run.task_set())));
        tell_faults(&run);
        let crossed = self.linux.end_recording(!self.is_shut_down());
        if let Some(outcome) = &crossed.0 {
            report::replayed(outcome);
        }
        if let Some(drained) = &crossed.1 {
            report::recorded(drained);
        }
        wires.iter().for_each(|ends| report::tell_wire(&ends.wire));
        for (peer, connection) in self.protocols.take().iter_mut() {
            connection.close();
            connection.with_protocol(|protocol, ends| {
                ends.iter().for_each(|end| report::tell_wire(end.wire()));
                report::tell_protocol(peer, protocol);
            });
        }
        Ok(run.into_run())
    }

    fn is_shut_down(&self) -> bool {
        self.signals.count() > 0 || self.is_closed.get()
    }

    fn connect(
        &self,
        wire: &Wire,
        options: &CommandLine<'static>,
        _module: &Cell<Option<&'static [u8]>>,
    ) -> Result<(), AppError> {
        let (name, word) = (wire.name(), word_of(wire, options)?);
        let refused = |line: String| Err(UsageError::new(line).into());
        let ends = match word {
            Some(EndpointWord::Port(port)) => Ends::Udp(port, None),
            Some(EndpointWord::Peer(peer)) => Ends::Udp(0, Some(peer)),
            Some(EndpointWord::File) => {
                let line = "a script of times is for the machine; on Linux give udp://:PORT";
                return refused(format!("`wire.{name}=file`: {line}"));
            }
            Some(EndpointWord::Serial) | None => {
                Ends::Bytes(options.text("input").is_some(), options.text("output"))
            }
        };
        let mut wires = self.wires.borrow_mut();
        if let Ends::Bytes(is_live, output) = ends {
            let are_taken = |other: &WireEnds| matches!(other.ends, Ends::Bytes(..));
            if options.text("input").is_some_and(|input| input != "-") {
                let line = "`input`: a script of times is for the machine; on Linux give `input=-`";
                return refused(line.into());
            }
            if is_live && self.has_console {
                let line = "`input=-` and `console=on` both take standard input; give one";
                return refused(line.into());
            }
            let lack = match (is_live || output.is_some(), wires.iter().any(are_taken)) {
                (false, _) => Some("has no ends; give --input -, --output FILE"),
                (true, true) => {
                    Some("finds its ends taken by another wire; give it others, such as")
                }
                (true, false) => None,
            };
            if let Some(lack) = lack {
                return refused(format!("wire `{name}` {lack} or `wire.{name}=udp://:PORT`"));
            }
        }
        wires.push(WireEnds {
            wire: wire.clone(),
            ends,
        });
        Ok(())
    }

    fn connect_protocol(
        &self,
        protocol: Box<dyn Protocol>,
        peer: SocketAddrV4,
        _options: &CommandLine<'static>,
    ) -> Result<(), AppError> {
        let connected = self.linux.connect_protocol(protocol, peer);
        let failure = |why| AppError::Failure(format!("`router=udp://{peer}`: {why}"));
        let connection = connected.map_err(failure)?;
        self.protocols.borrow_mut().push((peer, connection));
        Ok(())
    }

    fn seed() -> u128 {
        let mut bytes = [0; 16];
        let read = File::open("/dev/urandom").and_then(|mut file| file.read_exact(&mut bytes));
        // Without the device, the time has to do.
        let time = || Self::unix_ns().unwrap_or(0).into();
        read.map_or_else(|_| time(), |()| u128::from_le_bytes(bytes))
    }

    fn unix_ns() -> Option<u64> {
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH);
        u64::try_from(since_1970.ok()?.as_nanos()).ok()
    }

    fn measure_overheads(_margin_percent: u32) -> Result<(), AppError> {
        let line = "`overheads`: what Linux costs is not measured; state it by `overheads_ns=`, \
                    or run the app on the machine";
        Err(UsageError::new(line).into())
    }

    fn memory() -> HeapUsage {
        heap::usage(usize::try_from(memory_kib() * 1024).unwrap_or(usize::MAX))
    }
}

/// Prints the faults of the run, in the form printed by the kernel at once.
fn tell_faults(run: &linux::Run) {
    for fault in run.faults() {
        let instance = fault.instance;
        let cause = if fault.is_overrun {
            "budget overrun"
        } else {
            "panic"
        };
        let dag = run.task_set().dag(instance.dag);
        let names: [&dyn fmt::Display; 2] = [&dag.name(), &dag.subtask(instance.subtask).name()];
        let first = run
            .task_set()
            .cores_of(dag.cluster(), run.options().cores)
            .start;
        let place = fault.place.as_deref().unwrap_or("an unknown place");
        let place = (first + fault.core.0, &place as _);
        report::fault(
            (instance, names),
            (cause, &fault.cause),
            place,
            fault.cost,
            |_| (),
        );
    }
}

/// Returns the computer's memory size, in KiB.
pub(crate) fn memory_kib() -> u64 {
    let text = fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with("MemTotal:"));
    let number = line.and_then(|line| line.split_whitespace().nth(1)?.parse().ok());
    number.unwrap_or(0)
}

/// Bytes of standard input; the reading thread lasts as long as the program itself.
static INPUT: OnceLock<Mutex<Receiver<u8>>> = OnceLock::new();

/// The run of this program.
#[derive(Debug)]
pub struct LinuxRun;

impl LiveRun for LinuxRun {
    fn task_set() -> Option<Arc<TaskSet>> {
        Some(Arc::clone(Control::get()?.task_set()))
    }

    fn control(dag: DagId, change: fn(DagId) -> Request) {
        if let Some(live) = Control::get() {
            live.change(dag, change);
            // The next output has to show the change.
            live.wait_for_letters(dag);
        }
    }

    fn now_ns() -> u64 {
        linux::now_ns()
    }

    fn ask(cluster: usize, query: SchedulerQuery<'_>) -> Option<u64> {
        Control::get()?.ask(cluster, query)
    }

    fn receive() -> Option<u8> {
        let input = INPUT.get()?.lock().unwrap_or_else(PoisonError::into_inner);
        match input.try_recv() {
            Ok(byte) => Some(byte),
            // Nobody could end such a run any more.
            Err(TryRecvError::Disconnected) if is_endless() => Some(END),
            Err(_) => None,
        }
    }
}

/// Reports whether a run goes on that does not end by itself.
fn is_endless() -> bool {
    let has_end = |live: Control| {
        live.task_set()
            .dags()
            .iter()
            .all(|dag| dag.jobs().is_some())
    };
    !IS_SHUT_DOWN.load(Ordering::Relaxed) && !Control::get().is_none_or(has_end)
}

/// Shows the log and, if there is a console, talks with a person, from another thread, while `run`
/// runs. Reports whether the person has ended the run.
pub(crate) fn talk_during<R>(has_console: bool, run: impl FnOnce() -> R) -> (R, bool) {
    let listen = || {
        let (bytes, input) = channel();
        thread::spawn(move || {
            let all = BufReader::new(io::stdin()).bytes().map_while(Result::ok);
            // The last line may lack its end.
            for byte in all.chain(*b"\n") {
                if bytes.send(byte).is_err() {
                    break;
                }
            }
        });
        Mutex::new(input)
    };
    if has_console {
        INPUT.get_or_init(listen);
    }
    IS_SHUT_DOWN.store(false, Ordering::Relaxed);
    // The thread is not scoped: if `run` panics, nobody waits for it.
    let shared = Arc::new((Barrier::new(2), AtomicBool::new(false)));
    let (has_begun, is_over) = &*shared;
    let own = Arc::clone(&shared);
    let thread = thread::spawn(move || {
        let (has_begun, is_over) = &*own;
        let mut session = has_console.then(|| ShellSession::<LinuxRun>::new(false));
        let mut is_raised = !has_console;
        has_begun.wait();
        while !is_over.load(Ordering::Acquire) {
            if let Some(control) = Control::get() {
                if !is_raised {
                    control.raise();
                    is_raised = true;
                }
                tell_log(|| Some(Arc::clone(control.task_set())));
            }
            while session.as_mut().is_some_and(ShellSession::slice) {}
            thread::park_timeout(Duration::from_nanos(PERIOD_NS));
        }
    });
    // The allocations at the thread's start must not count as the run's.
    has_begun.wait();
    let result = run();
    is_over.store(true, Ordering::Release);
    thread.thread().unpark();
    thread.join().expect("what it prints does not panic");
    (result, IS_SHUT_DOWN.load(Ordering::Relaxed))
}
