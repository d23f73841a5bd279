//! The program's way to the app's function, and its end.
//!
//! # The command-line options on Linux
//!
//! - `cores=N`: the number of cores, out of the processors available to the program. Default: all
//!   of them.
//! - `share=off|on`: whether several cores share a processor if there are more cores than
//!   processors. Default: `off`.
//! - `mechanism=fifo|sched_ext|normal|poll`: the scheduling class of Linux used for threads.
//!   Default: `fifo`.
//! - `module=FILE`: a file for the app.
//! - `wcets=N`: the first N bytes of the file are observed WCETs. Default: 0.
//! - `wire.NAME=udp://[ADDRESS]:PORT`: the wire hears everyone on this port, or this peer alone.
//! - `input=-`: bytes from standard input arrive on the app's other wire.
//! - `output=FILE`: the file for bytes sent by the app on that wire.
//! - `console=off|on`: whether a person at standard input can talk with a run. Default: `off`.
//! - `keep=FILE`: the file for the record of the run, written also during the run.
//! - `events=FILE|on`: without `keep`, the file for the run's commits, events and times, written
//!   when a run is over; `on` is for lines of the output.
//! - `replay=FILE`: the run replays this recording.
//! - `from=DAG/JOB`: the replay begins with that job, or with the last job before it whose states
//!   are all recorded. Default: all jobs.
//! - `limit_ms=N`: Linux ends the program when a thread has run at a real-time level for N ms
//!   without waiting; 0: never. Default: 0.
//!
//! In addition, `policy`, `preemption`, `budget_factor`, `overheads_ns`, `bounds` and `log` mean
//! the same as on the machine.

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

/// Makes the program run an app's function: defines the function `program`, for the file with the
/// app's `main.rs` as its module.
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

/// Runs an app with the options of the program's command line.
pub fn start(name: &'static str, app: fn(&Machine) -> Result<(), AppError>) -> ExitCode {
    program::run(|| run(name, program::command_line(), app))
}

fn run(
    name: &'static str,
    line: &'static str,
    app: fn(&Machine) -> Result<(), AppError>,
) -> Result<(), AppError> {
    // A reader of the first line may ask for an end at once.
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
    // The record states by which options it is to be judged, because the tool may never see the
    // output.
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

/// Reads the options, and makes the machine described by them. Returns the machine, and the app's
/// file.
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
