//! The checks that are cargo's: formatter, linter, documentation.

use super::own;
use crate::lasting::Lasting;
use crate::system;

/// A check: its name, and what runs it.
type Check = (&'static str, fn() -> Result<(), String>);

/// The checks in their order.
pub(super) const CHECKS: &[Check] = &[
    ("rustfmt has nothing to change", || {
        cargo("fmt --check", "", "run `cargo fmt`")
    }),
    ("clippy has nothing to say", || {
        cargo(
            "clippy --quiet --all-targets",
            "-- -D warnings",
            "see above",
        )
    }),
    ("rustdoc has nothing to say", || {
        cargo("doc --quiet --no-deps", "", "see above")
    }),
    ("rustdoc has nothing to say of private items", || {
        cargo(
            "doc --quiet --no-deps --document-private-items",
            "",
            "see above",
        )
    }),
];

/// Runs cargo on the project's own packages; whatever it says goes to the terminal only if
/// it fails.
fn cargo(words: &str, rest: &str, remedy: &str) -> Result<(), String> {
    let mut command = system::cargo();
    command.args(words.split(' '));
    for package in own::packages() {
        command.args(["-p", &package]);
    }
    command.args(rest.split_whitespace());
    command.env("RUSTDOCFLAGS", "-D warnings");
    let _lasting = Lasting::new(&format!("cargo {words}"));
    let output = command
        .output()
        .map_err(|error| format!("cannot start cargo: {error}"))?;
    if output.status.success() {
        return Ok(());
    }
    eprint!("{}", String::from_utf8_lossy(&output.stdout));
    eprint!("{}", String::from_utf8_lossy(&output.stderr));
    Err(format!("`cargo {words}` failed; {remedy}"))
}
