//! The host tool: its subcommands are what the scripts in `scripts/` call.
//!
//! A subcommand takes the words after its name and returns the exit code:
//! 0 all is well, 1 a failure, 2 a refused command line.

#![forbid(unsafe_code)]

use std::env;
use std::ffi::OsString;
use std::process::ExitCode;

use tool::options::{Choice, Menu};

static TOOL: Menu = Menu {
    invocation: "fass-tool",
    word: "SUBCOMMAND",
    about: "Does what the scripts in scripts/ are there for.",
    choices: &[
        Choice {
            name: "run",
            about: "boot an app in QEMU and judge the run",
            work: tool::run::run,
        },
        Choice {
            name: "debug",
            about: "boot an app in QEMU, under gdb",
            work: tool::run::debug,
        },
        Choice {
            name: "boot",
            about: "boot an image, and run any other program as it is: for cargo",
            work: tool::run::boot,
        },
        Choice {
            name: "image",
            about: "make a file that boots an app on a PC",
            work: tool::stick::image,
        },
        Choice {
            name: "new-app",
            about: "make an app of your own, in a repository of its own or under apps/",
            work: tool::new_app::new_app,
        },
        Choice {
            name: "test",
            about: "run every test, on the host and in QEMU",
            work: tool::test::test,
        },
        Choice {
            name: "oracle",
            about: "compare reference cases with the scheduler and its analysis",
            work: tool::oracle::oracle,
        },
        Choice {
            name: "check-trace",
            about: "replay the traces of runs against the model's rules",
            work: tool::trace::check_trace,
        },
        Choice {
            name: "trace",
            about: "convert the traces of runs for Perfetto's viewer",
            work: tool::trace::trace,
        },
        Choice {
            name: "recording",
            about: "show a recording, and convert it from and to other formats",
            work: tool::recordings::recording,
        },
        Choice {
            name: "bench",
            about: "measure parts of the project on this host",
            work: tool::bench::bench,
        },
        Choice {
            name: "soak",
            about: "run random DAG sets for a long time and check everything",
            work: tool::soak::soak,
        },
    ],
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
