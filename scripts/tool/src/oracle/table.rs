//! What `oracle KIND` accepts.

use crate::options::{Command, Takes, options};

/// What all kinds have in common, for the help texts.
pub(super) const NOTES: &str = "\
Prints the first difference of each failing case, then `N passed, M failed`.

Exit code: 0 none failed, 1 some failed, 2 a file or the command line is refused.
";

const FILES: Option<(Takes, &str)> = Some((
    Takes::File("FILE..."),
    "Reference files, as in tests/oracle.",
));

pub(super) static BOUNDS: Command = Command {
    invocation: "./scripts/oracle bounds",
    about: "Compares lengths, widths, response-time bounds and verdicts with those of the \
            analysis at commit.",
    positional: FILES,
    options: &[],
    notes: NOTES,
};

pub(super) static SCHEDULES: Command = Command {
    invocation: "./scripts/oracle schedules",
    about: "Compares starts, finishes, preemptions, response times and misses with those of \
            the scheduler in virtual time.",
    positional: FILES,
    options: options! {
        /// On the bare machine; with options of its own, see schedules --in-kernel --help.
        "in-kernel": Takes::Nothing;
    },
    notes: NOTES,
};

pub(super) static SYNCHRONIZER: Command = Command {
    invocation: "./scripts/oracle synchronizer",
    about: "Compares the sets that ExactTime and ApproximateTime emit, and what they drop, \
            with those of the publish/subscribe baseline.",
    positional: FILES,
    options: &[],
    notes: NOTES,
};
