//! The laboratory: commands that measure, judge and test the project itself.
//!
//! An app's author needs none of them. The laboratory builds on the tool's library; the tool uses
//! nothing of the laboratory. `docs/decisions/0052-product-and-laboratory-apart.md` has the
//! reasons.
//!
//! - [`mod@bench`]: measurements, compared with a baseline;
//! - [`oracle`]: reference schedules, bounds and synchronizers;
//! - [`soak`](mod@soak): random DAG sets for a long time;
//! - [`test`](mod@test): every test, and checks of the whole tree;
//! - [`golden`]: texts in the tree, compared by tests with the output of programs.

#![forbid(unsafe_code)]

// The tool's printing macros replace the standard library's, which panic when a reader has left.
#[macro_use(print, println, eprint, eprintln)]
extern crate tool;

pub mod bench;
pub mod golden;
pub mod oracle;
pub mod soak;
pub mod test;

use tool::options::{WordMenu, choices};

/// The laboratory's subcommands.
pub static LAB: WordMenu = WordMenu {
    invocation: "fass-lab",
    word: "SUBCOMMAND",
    about: "Measures, judges and tests the project itself.",
    choices: choices! {
        "test": "run every test, on the host and in QEMU", test::test;
        "oracle": "compare reference cases with the scheduler and its analysis", oracle::oracle;
        "bench": "measure parts of the project on this host", bench::bench;
        "soak": "run random DAG sets for a long time and check everything", soak::soak;
    },
    notes: "Exit codes: 0 all is well, 1 a failure, 2 a refused command line.\n",
};

#[cfg(test)]
mod tests;
