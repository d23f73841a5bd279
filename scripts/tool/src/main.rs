//! The host tool. The scripts in `scripts/` call its subcommands.
//!
//! A subcommand takes the words after its name and returns the exit code:
//! 0 all is well, 1 a failure, 2 a refused command line.

#![forbid(unsafe_code)]

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
        "check-trace": "replay the traces of runs against the model's rules",
            tool::trace::check_trace;
        "trace": "convert the traces of runs for Perfetto's viewer", tool::trace::trace;
        "recording": "show a recording, and convert it from and to other formats",
            tool::recordings::recording;
    },
    notes: "Exit codes: 0 all is well, 1 a failure, 2 a refused command line.\n",
};

fn main() -> ExitCode {
    TOOL.carry_out()
}
