//! What `test` accepts: the one table behind its parser and its help text.

use crate::options::{Command, Takes, options};

/// The table of `test`.
pub static TEST: Command = Command {
    invocation: "./scripts/test",
    about: "Runs every test, on the host and in QEMU, and counts them.",
    positional: Some((
        Takes::Text("FILTER"),
        "Run only tests and checks whose name contains this.",
    )),
    options: options! {
        /// Only what runs on the host: no guests, no images, no lints.
        "quick": Takes::Nothing;
        /// Rewrite what a change makes wrong: fault texts and outputs in pages, baselines.
        "bless": Takes::Nothing;
        /// Show every test by name, not only those that fail.
        "verbose" 'v': Takes::Nothing;
    },
    notes: "\
The last line is `N passed, M failed`, or `N passed, M failed, K skipped` with
the reasons above it; above these stand the parts that took longest, in seconds.

With --bless the files that were rewritten stand there, too; `git diff` shows what
has changed in them. What cannot be rewritten still fails.

exit codes: 0 nothing failed; 1 something failed; 2 a refused command line, or
a FILTER by which nothing has run
",
};
