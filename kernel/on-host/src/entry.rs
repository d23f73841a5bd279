//! The program's way to the app's function, and its end.
//!
//! # The words of the command line that virtual time takes
//!
//! | word | meaning | default |
//! | --- | --- | --- |
//! | `cores=N` | the number of cores | 8 |
//! | `module=FILE` | a file for the app | |
//! | `wcets=N` | the first N bytes of it are WCETs that were observed | 0 |
//! | `keep=FILE`, `events=FILE` | the record of the run is written there | |
//! | `tests=off\|on` | whether each test of the commit is asked for its own bounds | `off` |
//!
//! Besides, `policy`, `preemption`, `budget_factor`, `overheads_ns`, `bounds` and `log` mean
//! what they mean on the machine.
//!
//! If the file has parts, between form feeds, the app is run for each. The lines of each
//! end with its verdict.

use std::borrow::Cow;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;

use fass::platform::RunConfig;
use front::app::ending::{self, AppError, AppExit, RunVerdict};
use front::app::terms::{self, RunTerms};
use front::json;
use front::options::{CommandLine, UsageError};
pub use front::output;

use crate::host_system::{HostSystem, Machine};
pub use crate::output::write_as;

/// Makes an app's function the one that the program runs: the function `program`, for the file
/// that has the app's `main.rs` as its module.
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

/// What stands between the parts of a file.
const FORM_FEED: u8 = 0x0c;

/// Runs an app with the words of the program's command line. The exit code is 0 after a
/// success, 1 after a failure, 2 if the command line is refused; of several parts it is 0.
pub fn start(name: &'static str, app: App) -> ExitCode {
    let line = std::env::args().skip(1).collect::<Vec<_>>().join(" ");
    let line: &'static str = line.leak();
    // A file that cannot be read is refused in `attempt`.
    let module = CommandLine::parse(line).and_then(|options| read(&options));
    let parts: Vec<_> = match module {
        Ok(Some(bytes)) => bytes.split(|byte| *byte == FORM_FEED).map(Some).collect(),
        _ => vec![None],
    };
    if let [part] = parts[..] {
        return match run(name, line, app, part) {
            AppExit::Success => ExitCode::SUCCESS,
            AppExit::Failure => ExitCode::FAILURE,
            AppExit::Usage => ExitCode::from(2),
        };
    }
    for part in parts {
        run(name, line, app, part);
    }
    ExitCode::SUCCESS
}

/// Runs the app, and tells how it has ended.
fn run(name: &'static str, line: &'static str, app: App, part: Option<&'static [u8]>) -> AppExit {
    let result = catch_unwind(AssertUnwindSafe(|| attempt(name, line, app, part)));
    let result = result.unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<&str>().copied();
        let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
        let text = text.unwrap_or("it says nothing");
        Err(AppError::Failure(format!(
            "the app's function panicked: {text}"
        )))
    });
    ending::tell(&result)
}

fn attempt(
    name: &'static str,
    line: &'static str,
    app: App,
    part: Option<&'static [u8]>,
) -> Result<(), AppError> {
    let options = CommandLine::parse(line)?;
    let chosen = RunTerms::read(&options)?;
    let cores = options.number("cores", 1..=1024, 8)?;
    let module = match part {
        Some(part) => Some(part),
        None => read(&options)?,
    };
    let _ = options.text("module");
    let (wcets, module) = terms::split_wcets(&options, module)?;
    let mut terms = RunConfig::default();
    terms.scheduler.cores = u32::try_from(cores).unwrap_or(u32::MAX);
    terms.wcets = wcets.map(Cow::Borrowed);
    chosen.apply(&mut terms);
    let [keep, events] = ["keep", "events"].map(|word| options.text(word));
    let tells_tests = options.choice("tests", &[("off", false), ("on", true)])?;
    json::report("boot", |object| {
        object
            .text("version", env!("CARGO_PKG_VERSION"))
            .text("app", name)
            .number("cpus", cores)
            .number("memory_kib", 0_u64)
            .text("clock", "virtual")
            .text("command_line", line);
    });
    let system = HostSystem::new(terms, keep.or(events), tells_tests);
    let verdict = RunVerdict::new(chosen.judges_bounds, false);
    Machine::serve(system, options, module, verdict, app)
}

/// Reads the file that the word `module` names. It stays as long as the program, as the loader's
/// does.
fn read(options: &CommandLine<'static>) -> Result<Option<&'static [u8]>, UsageError> {
    let Some(path) = options.text("module") else {
        return Ok(None);
    };
    let bytes = fs::read(path);
    let bytes = bytes.map_err(|why| UsageError::new(format!("`module={path}`: {why}")))?;
    Ok(Some(bytes.leak()))
}
