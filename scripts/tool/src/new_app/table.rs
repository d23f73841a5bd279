//! What `new-app` accepts: the one table behind its parser and its help text.

use crate::options::{Command, Takes};

/// The table of `new-app`.
pub static NEW_APP: Command = Command {
    invocation: "./scripts/new-app",
    about: "\
Makes an app of your own under apps/: a library with functions and their DAG, a
program that boots it, and a test that runs it on the host in virtual time.",
    positional: Some((
        Takes::Text("NAME"),
        "The app's name: small letters, digits and hyphens, a letter first, at most 32.",
    )),
    options: &[],
    notes: "\
./scripts/run --app NAME boots it, cargo test -p NAME tests it, and docs/guide.md
shows what to do next.

exit codes: 0 the app is there; 1 its files cannot be written; 2 a refused
command line
",
};
