//! The checks that are cargo's: formatter, linter, documentation.

use crate::system;

/// A check: its name, and what runs it.
type Check = (&'static str, fn() -> Result<(), String>);

/// The checks in their order.
pub(super) const CHECKS: &[Check] = &[
    ("rustfmt has nothing to change", || {
        cargo(&["fmt", "--all", "--check"], "run `cargo fmt`")
    }),
    ("clippy has nothing to say", || {
        let words = "clippy --quiet --workspace --all-targets -- -D warnings";
        cargo(&words.split(' ').collect::<Vec<_>>(), "see above")
    }),
    ("rustdoc has nothing to say", || {
        cargo(&["doc", "--quiet", "--workspace", "--no-deps"], "see above")
    }),
    ("rustdoc has nothing to say of private items", || {
        let words = "doc --quiet --workspace --no-deps --document-private-items";
        cargo(&words.split(' ').collect::<Vec<_>>(), "see above")
    }),
];

/// Runs cargo; whatever it says goes to the terminal only if it fails.
fn cargo(words: &[&str], remedy: &str) -> Result<(), String> {
    let mut command = system::cargo();
    command.args(words).env("RUSTDOCFLAGS", "-D warnings");
    let output = command
        .output()
        .map_err(|error| format!("cannot start cargo: {error}"))?;
    if output.status.success() {
        return Ok(());
    }
    eprint!("{}", String::from_utf8_lossy(&output.stdout));
    eprint!("{}", String::from_utf8_lossy(&output.stderr));
    Err(format!("`cargo {}` failed; {remedy}", words.join(" ")))
}
