//! The laboratory's program. The scripts in `scripts/` call its subcommands, as they do the tool's.

#![forbid(unsafe_code)]

use std::process::ExitCode;

use tool::options::{Menu, choices};

static LAB: Menu = Menu {
    invocation: "fass-lab",
    word: "SUBCOMMAND",
    about: "Measures, judges and tests the project itself.",
    choices: choices! {
        "test": "run every test, on the host and in QEMU", lab::test::test;
        "oracle": "compare reference cases with the scheduler and its analysis",
            lab::oracle::oracle;
        "bench": "measure parts of the project on this host", lab::bench::bench;
        "soak": "run random DAG sets for a long time and check everything", lab::soak::soak;
    },
    notes: "Exit codes: 0 all is well, 1 a failure, 2 a refused command line.\n",
};

fn main() -> ExitCode {
    LAB.carry_out()
}
