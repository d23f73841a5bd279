//! What `new-app` accepts: the one table behind its parser and its help text.

use crate::options::{Command, Takes, options};

/// The table of `new-app`.
pub static NEW_APP: Command = Command {
    invocation: "./scripts/new-app",
    about: "\
Makes an app of your own, in a repository of its own or under apps/: a library with
functions and their DAG, a program that boots it, and a test that runs it on the host in
virtual time.",
    positional: Some((
        Takes::Text("NAME"),
        "The app's name: small letters, digits and hyphens, a letter first, at most 32.",
    )),
    options: options! {
        /// Make the app in this new folder, which is the root of a repository.
        "out": Takes::File("DIR");
        /// --out: take the crates from this git repository, not from the folder of these commands.
        /// Its runner is `fass-tool boot`, which `cargo install --git URL tool` installs.
        "git": Takes::Text("URL");
    },
    notes: "\
With --out, cargo run boots the app and cargo test tests it; without, it is in apps/,
./scripts/run --app NAME boots it and cargo test -p NAME tests it. docs/guide.md shows
what to do next.

exit codes: 0 the app is there; 1 its files cannot be written; 2 a refused
command line
",
};
