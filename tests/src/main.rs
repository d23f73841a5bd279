//! The host tool: its subcommands are what the scripts in `scripts/` call.
//!
//! A subcommand takes the words after its name and returns the exit code:
//! 0 all is well, 1 a failure, 2 a refused command line.

#![forbid(unsafe_code)]

use std::env;
use std::process::ExitCode;

use harness::options::nearest;

/// A subcommand's work.
type Work = fn(&[String]) -> ExitCode;

/// The subcommands: name, what it does in a few words, and its function.
const SUBCOMMANDS: &[(&str, &str, Work)] = &[
    (
        "run",
        "boot an app in QEMU and judge the run",
        harness::run::run,
    ),
    (
        "new-app",
        "make an app of your own under apps/",
        harness::new_app::new_app,
    ),
    (
        "test",
        "run every test, on the host and in QEMU",
        harness::test::test,
    ),
    (
        "oracle",
        "compare reference cases with the scheduler and its analysis",
        harness::oracle::oracle,
    ),
    (
        "check-trace",
        "replay the traces of runs against the model's rules",
        harness::trace::check_trace,
    ),
    (
        "trace",
        "convert the traces of runs for Perfetto's viewer",
        harness::trace::trace,
    ),
    (
        "bench",
        "measure parts of the project on this host",
        harness::bench::bench,
    ),
    (
        "soak",
        "run random DAG sets for a long time and check everything",
        harness::soak::soak,
    ),
];

fn main() -> ExitCode {
    if let Some(folder) = env::var_os("HARNESS_CALLED_IN") {
        // Set by `scripts/harness`. If the folder is gone, we stay where we are.
        let _ = env::set_current_dir(folder);
    }
    let words: Vec<String> = env::args().skip(1).collect();
    let Some((name, rest)) = words.split_first() else {
        eprint!("harness: which subcommand?\n{}", list());
        return ExitCode::from(2);
    };
    if name == "--help" || name == "-h" {
        print!("{}", list());
        return ExitCode::SUCCESS;
    }
    match SUBCOMMANDS.iter().find(|(known, ..)| known == name) {
        Some((_, _, work)) => work(rest),
        None => {
            let names: Vec<&str> = SUBCOMMANDS.iter().map(|(name, ..)| *name).collect();
            let hint = nearest(name, &names)
                .map_or(String::new(), |near| format!("; did you mean `{near}`?"));
            eprint!("harness: no subcommand `{name}`{hint}\n{}", list());
            ExitCode::from(2)
        }
    }
}

fn list() -> String {
    let line = |(name, about, _): &(&str, &str, Work)| format!("  {name:12}{about}\n");
    let lines: String = SUBCOMMANDS.iter().map(line).collect();
    format!("usage: harness SUBCOMMAND [options]; each explains itself by --help\n\n{lines}")
}
