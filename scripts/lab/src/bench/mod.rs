//! Measurements on the host, for people and for machines.
//!
//! `bench WHAT` measures one part of the project on this host, in this build, and prints a table
//! and a JSON object for each figure. Times depend on the host and its load, so no time has a
//! limit; counts of instructions and bytes have limits. The exit code is 0 if all limits hold, 1 if
//! any does not, and 2 for a refused command line.
//!
//! - [`bounds`]: random sets of DAGs accepted by methods of analysis;
//! - [`hand_off`]: the way from a completion to its successor, on the machine;
//! - [`join_latency`]: the paper's evaluation, on the machine in QEMU;
//! - [`native`]: the scheduler on the host's own processors;
//! - [`sizes`]: the size of each part of an image.

mod acceptance;
mod baseline;
pub mod bounds;
mod code;
mod frame;
pub mod hand_off;
pub mod join_latency;
pub mod native;
pub mod sizes;

use std::ffi::OsString;
use std::process::ExitCode;

use tool::options::{WordMenu, choices};

static BENCH: WordMenu = WordMenu {
    invocation: "./scripts/bench",
    word: "WHAT",
    about: "Measures one part of the project.",
    choices: choices! {
        "bounds": "random sets that methods of analysis accept, by load and cores", bounds::run;
        "hand-off": "from a completion to its successor's first instruction", hand_off::run;
        "join-latency": "the paper's evaluation: samples, figures, plots and a report",
            join_latency::run;
        "native": "the scheduler on this host's own processors", native::run;
        "sizes": "what each part of an image takes of its room", sizes::run;
    },
    notes: "Exit code: 0 all limits hold, 1 one does not, 2 the command line is refused.\n",
};

/// Runs the subcommand `bench` with the words after its name.
pub fn bench(words: &[OsString]) -> ExitCode {
    BENCH.run(words)
}
