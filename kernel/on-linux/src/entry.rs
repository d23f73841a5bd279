//! The program's way to the app's function, and its end.
//!
//! # The words of the command line that Linux takes, and those that it has no use for
//!
//! | word | meaning | default |
//! | --- | --- | --- |
//! | `cores=N` | how many of the processors that the program may use are its cores | all of them |
//! | `share=off\|on` | whether several cores share a processor where there are more cores | `off` |
//! | `mechanism=fifo\|sched_ext\|normal\|poll` | by which class of Linux's threads run | `fifo` |
//! | `module=FILE` | a file for the app | |
//! | `wcets=N` | the first N bytes of it are WCETs that were observed | 0 |
//! | `wire.NAME=udp://[ADDRESS]:PORT` | that wire hears everyone on this port, or this peer alone | |
//! | `input=-` | what comes on standard input arrives on the app's other wire | |
//! | `output=FILE` | what the app sends on that goes there | |
//! | `console=off\|on` | whether a person at standard input can talk with a run | `off` |
//! | `keep=FILE` | the record of the run is written there, also while it goes on | |
//! | `events=FILE\|on` | without `keep`: its commits, events and times are, when a run is over; `on` is for lines of the output | |
//! | `replay=FILE` | the run replays that recording | |
//! | `from=DAG/JOB` | from that job on, or the last one before it of which all states are recorded | all jobs |
//! | `limit_ms=N` | Linux ends the program when a thread has run at a real-time level for so long without waiting; 0: never | 0 |
//!
//! Besides, `policy`, `preemption`, `budget_factor`, `overheads_ns`, `bounds` and `log` mean
//! what they mean on the machine.

use std::borrow::Cow;
use std::cell::{Cell, RefCell};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::process::ExitCode;
use std::time::Duration;

use fass::edge::Sink;
use front::app::ending::{AppError, RunVerdict};
use front::app::terms::{self, RunTerms};
use front::json;
use front::options::{CommandLine, UsageError};
pub use front::output;
use front::report::RecordLines;
use linux::{EndSignals, Linux, Mechanism};

use crate::linux_system::{LinuxSystem, Machine, memory_kib};
pub use crate::program::write_as;
use crate::program::{self, read};

/// Makes an app's function the one that the program runs: the function `program`, for the file
/// that has the app's `main.rs` as its module.
#[macro_export]
macro_rules! entry {
    ($app:path) => {
        #[global_allocator]
        static HEAP: $crate::Heap = $crate::Heap;

        $crate::entry::output!($crate::entry::write_as);

        /// Runs the app on this computer.
        pub(crate) fn program() -> std::process::ExitCode {
            $crate::entry::start(env!("CARGO_PKG_NAME"), $app)
        }
    };
}

/// Runs an app with the words of the program's command line.
pub fn start(name: &'static str, app: fn(&Machine) -> Result<(), AppError>) -> ExitCode {
    program::run(|| run(name, program::command_line(), app))
}

fn run(
    name: &'static str,
    line: &'static str,
    app: fn(&Machine) -> Result<(), AppError>,
) -> Result<(), AppError> {
    // Who sees the first line may ask for an end.
    let signals = EndSignals::catch_first();
    let options = CommandLine::parse(line)?;
    let (linux, module) = apply(name, &options)?;
    let boot = |object: &mut json::JsonObject<'_, '_>| {
        object
            .text("version", env!("CARGO_PKG_VERSION"))
            .text("app", name)
            .number("cpus", linux.terms().scheduler.cores)
            .number("memory_kib", memory_kib())
            .text("clock", "linux")
            .flag("preemptive", linux.is_preemptive())
            .text("command_line", line);
    };
    json::report("boot", boot);
    // The record, which the tool may never see, says by what it is to be judged.
    Linux::note(&format!("{}\n", json::line("boot", boot)));
    for warning in linux.warnings() {
        crate::println!("fass-linux: {warning}");
    }
    let system = LinuxSystem {
        linux,
        wires: RefCell::default(),
        protocols: RefCell::default(),
        refusal: RefCell::new(None),
        signals,
        has_console: options.choice("console", &[("off", false), ("on", true)])?,
        is_closed: Cell::new(false),
    };
    let verdict = RunVerdict::new(false, false);
    let result = Machine::serve(system, options, module, verdict, app);
    let kept = Linux::end_record();
    result.and_then(|()| kept.map_err(|why| AppError::Failure(format!("the record: {why}"))))
}

/// Takes the words, and makes the machine that they describe. Returns what they say besides, and
/// the app's file.
#[allow(clippy::too_many_lines, reason = "one word after the other")]
pub(crate) fn apply(
    app: &'static str,
    options: &CommandLine<'static>,
) -> Result<(Linux, Option<&'static [u8]>), UsageError> {
    let chosen = RunTerms::read(options)?;
    let mechanisms = [
        ("fifo", Mechanism::Fifo),
        ("sched_ext", Mechanism::SchedExt),
        ("normal", Mechanism::Normal),
        ("poll", Mechanism::Poll),
    ];
    let mechanism = options.choice("mechanism", &mechanisms)?;
    let cores = options.number("cores", 1..=1024, u64::from(linux::processors()))?;
    let limit_ms = options.number("limit_ms", 0..=86_400_000, 0)?;
    let module = options.text("module").map(|path| read("module", path));
    let module = module.transpose()?;
    let (wcets, module) = terms::split_wcets(options, module)?;
    let cores = u32::try_from(cores).unwrap_or(u32::MAX);
    let make = options.choice(
        "share",
        &[
            ("off", Linux::new as fn(u32, Mechanism) -> _),
            ("on", Linux::sharing),
        ],
    )?;
    let machine = make(cores, mechanism).map_err(|error| UsageError::new(error.to_string()))?;
    let machine = machine
        .with(|terms| {
            chosen.apply(terms);
            terms.wcets = wcets.map(Cow::Borrowed);
        })
        .allocations(crate::heap::allocations_of_runs);
    let replayed = options.text("replay");
    let words = ["keep", "events"].map(|word| Some((word, options.text(word)?)));
    match (words.into_iter().flatten().next(), replayed) {
        (Some(("keep", _)), Some(_)) => {
            let line = "`keep` excludes `replay`; give one";
            return Err(UsageError::new(line));
        }
        (Some(("events", "on")), _) => machine.keep_events(ToConsole(RecordLines::new())),
        (Some((word, path)), _) => {
            let file = File::create(path);
            let file = file.map_err(|why| UsageError::new(format!("`{word}={path}`: {why}")))?;
            let file = BufWriter::new(file);
            match word {
                "keep" => machine.keep(app, file),
                _ => machine.keep_events(file),
            }
        }
        (None, _) => {}
    }
    if let Some(path) = replayed {
        machine.replay(read("replay", path)?, terms::from(options)?);
    }
    if limit_ms > 0 {
        let limited = machine.limit_real_time(Duration::from_millis(limit_ms));
        limited.map_err(|why| UsageError::new(format!("`limit_ms={limit_ms}`: {why}")))?;
    }
    Ok((machine, module))
}

/// The record as lines of the program's output.
struct ToConsole(RecordLines);

impl Write for ToConsole {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.put(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush();
        Ok(())
    }
}
