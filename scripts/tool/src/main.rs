//! The host tool. The scripts in `scripts/` call its subcommands.
//!
//! A subcommand takes the words after its name and returns the exit code:
//! 0 all is well, 1 a failure, 2 a refused command line.

#![forbid(unsafe_code)]

use std::env;
use std::ffi::OsString;
use std::process::ExitCode;

use tool::options::{Menu, choices};

static TOOL: Menu = Menu {
    invocation: "fass-tool",
    word: "SUBCOMMAND",
    about: "Does what the scripts in scripts/ are there for.",
    choices: choices! {
        "run": "boot an app in QEMU and judge the run", tool::run::run;
        "debug": "boot an app in QEMU, under gdb", tool::run::debug;
        "boot": "boot an image, and run any other program as it is: for cargo", tool::run::boot;
        "image": "make a file that boots an app on a PC", tool::medium::image;
        "new-app": "make an app of your own, in a repository of its own or under apps/",
            tool::new_app::new_app;
        "test": "run every test, on the host and in QEMU", tool::test::test;
        "oracle": "compare reference cases with the scheduler and its analysis",
            tool::oracle::oracle;
        "check-trace": "replay the traces of runs against the model's rules",
            tool::trace::check_trace;
        "trace": "convert the traces of runs for Perfetto's viewer", tool::trace::trace;
        "recording": "show a recording, and convert it from and to other formats",
            tool::recordings::recording;
        "bench": "measure parts of the project on this host", tool::bench::bench;
        "soak": "run random DAG sets for a long time and check everything", tool::soak::soak;
    },
    notes: "Exit codes: 0 all is well, 1 a failure, 2 a refused command line.\n",
};

fn main() -> ExitCode {
    if let Some(folder) = env::var_os("TOOL_CALLED_IN") {
        // Set by `scripts/tool/start`. If the folder is gone, we stay where we are.
        let _ = env::set_current_dir(folder);
    }
    let words: Vec<OsString> = env::args_os().skip(1).collect();
    tool::output::conclude(TOOL.run(&words))
}
