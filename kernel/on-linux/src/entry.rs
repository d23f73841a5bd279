//! The program's way to the app's function, and its end.

use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;

use linux::{EndSignals, Linux};

pub use crate::output::write_as;
pub use front::output;

use crate::app::linux_system::{LinuxSystem, Machine, memory_kib};
use crate::app::words;
use crate::options::Options;
use front::app::ending::{self, Ending, Told};
use front::app::verdict::Verdict;
use front::json;

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

/// Runs an app with the words of the program's command line. The exit code is 0 after a
/// success, 1 after a failure, 2 if the command line is refused.
#[must_use]
pub fn start(name: &'static str, app: fn(&Machine) -> Result<(), Ending>) -> ExitCode {
    let line = std::env::args().skip(1).collect::<Vec<_>>().join(" ");
    let run = AssertUnwindSafe(|| run(name, line.leak(), app));
    let result = catch_unwind(run).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<&str>().copied();
        let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
        let text = text.unwrap_or("it says nothing");
        Err(Ending::Failure(format!(
            "the app's function panicked: {text}"
        )))
    });
    match ending::tell(&result) {
        Told::Success => ExitCode::SUCCESS,
        Told::Failure => ExitCode::FAILURE,
        Told::Usage => ExitCode::from(2),
    }
}

fn run(
    name: &'static str,
    line: &'static str,
    app: fn(&Machine) -> Result<(), Ending>,
) -> Result<(), Ending> {
    // Who sees the first line may ask for an end.
    let signals = EndSignals::catch_first();
    let options = Options::parse(line)?;
    let (linux, module) = words::apply(name, &options)?;
    json::report("boot", |object| {
        object
            .text("version", env!("CARGO_PKG_VERSION"))
            .text("app", name)
            .number("cpus", linux.terms().scheduler.cores)
            .number("memory_kib", memory_kib())
            .text("clock", "linux")
            .flag("preemptive", linux.is_preemptive())
            .text("command_line", line);
    });
    for warning in linux.warnings() {
        crate::println!("fass-linux: {warning}");
    }
    let system = LinuxSystem {
        linux,
        wire: RefCell::new(None),
        refusal: RefCell::new(None),
        signals,
        has_console: options.choice("console", &[("off", false), ("on", true)])?,
        is_closed: Cell::new(false),
    };
    let verdict = Verdict::new(false, false);
    let result = Machine::serve(system, options, module, verdict, app);
    let kept = Linux::end_record();
    result.and_then(|()| kept.map_err(|why| Ending::Failure(format!("the record: {why}"))))
}
