//! The program's way to the app's function, and its end.
//!
//! # The command-line options in virtual time
//!
//! | option | meaning | default |
//! | --- | --- | --- |
//! | `cores=N` | the number of cores | 8 |
//! | `module=FILE` | a file for the app | |
//! | `wcets=N` | the first N bytes of the file are observed WCETs | 0 |
//! | `keep=FILE`, `events=FILE\|on` | the file for the run's record; `on`: lines of the output | |
//! | `tests=off\|on` | whether each test of the commit is asked for its own bounds | `off` |
//!
//! In addition, `policy`, `preemption`, `budget_factor`, `overheads_ns`, `bounds` and `log` mean
//! the same as on the machine.
//!
//! If the file has parts, separated by form feeds, the app is run for each part. The lines of each
//! run end with its verdict.

use std::borrow::Cow;
use std::cell::{Cell, RefCell};
use std::process::ExitCode;

use fass::platform::RunConfig;
use front::app::ending::{AppError, RunVerdict};
use front::app::terms::{self, RunTerms};
use front::json;
use front::options::{CommandLine, UsageError};
pub use front::output;

use crate::host_system::{HostSystem, Machine, with_terms};
use crate::program;
pub use crate::program::write_as;

/// Makes the program run an app's function: defines the function `program`, for the file with the
/// app's `main.rs` as its module.
#[macro_export]
macro_rules! entry {
    ($app:path) => {
        $crate::entry::output!($crate::entry::write_as);

        /// Runs the app in virtual time.
        pub(crate) fn program() -> std::process::ExitCode {
            $crate::entry::start(env!("CARGO_PKG_NAME"), $app)
        }
    };
}

type App = fn(&Machine) -> Result<(), AppError>;

/// An app's file, or a part of the file.
type Module = Option<&'static [u8]>;

/// Runs an app with the options of the program's command line. With several parts, returns the exit
/// code of the last part.
pub fn start(name: &'static str, app: App) -> ExitCode {
    let line = program::command_line();
    let module = CommandLine::parse(line).and_then(|options| {
        let path = options.text("module");
        path.map(|path| program::read("module", path)).transpose()
    });
    let parts = match module {
        Ok(Some(bytes)) => bytes
            .split(|byte| *byte == FORM_FEED)
            .map(|it| Ok(Some(it)))
            .collect(),
        other => vec![other],
    };
    let run = |part| program::run(|| attempt(name, line, app, part));
    parts
        .into_iter()
        .fold(ExitCode::SUCCESS, |_, part| run(part))
}

/// The character between the parts of a file.
const FORM_FEED: u8 = 0x0c;

fn attempt(
    name: &'static str,
    line: &'static str,
    app: App,
    module: Result<Module, UsageError>,
) -> Result<(), AppError> {
    let options = CommandLine::parse(line)?;
    let chosen = RunTerms::read(&options)?;
    let cores = options.number("cores", 1..=1024, 8)?;
    // Mark the option as taken; the file has been read already.
    let _ = options.text("module");
    let (wcets, module) = terms::split_wcets(&options, module?)?;
    let mut terms = RunConfig::default();
    terms.scheduler.cores = u32::try_from(cores).unwrap_or(u32::MAX);
    terms.wcets = wcets.map(Cow::Borrowed);
    chosen.apply(&mut terms);
    let [keep, events] = ["keep", "events"].map(|word| options.text(word));
    let system = HostSystem {
        machine: RefCell::new(with_terms(terms)),
        record_to: Cell::new(keep.or(events)),
        tells_tests: options.choice("tests", &[("off", false), ("on", true)])?,
        has_window: Cell::new(false),
    };
    json::report("boot", |object| {
        object
            .text("version", env!("CARGO_PKG_VERSION"))
            .text("app", name)
            .number("cpus", cores)
            .number("memory_kib", 0_u64)
            .text("clock", "virtual")
            .text("command_line", line);
    });
    let verdict = RunVerdict::new(chosen.judges_bounds, false);
    Machine::serve(system, options, module, verdict, app)
}
