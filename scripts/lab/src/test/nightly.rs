//! `--miri` and `--thread-sanitizer`: tests under tools that look where threads meet.
//!
//! Both come with a nightly toolchain of Rust only. So they are asked for, and never needed. Miri
//! executes every access by the rules of the language, and shows an atomic's old values where these
//! allow that; many *seeds* are as many interleavings. It is slow, so counts shrink under
//! `cfg!(miri)`, and it has neither assembly nor Linux' scheduling calls. ThreadSanitizer sees data
//! races of whole runs on Linux' threads, as they happen to interleave.

use std::process::Command;

use super::{Tally, TestPlan, libtest};
use tool::system;

/// The tests that Miri runs together: a name, cargo's words, and how many seeds. Those with one seed
/// have one thread, or are too slow for more.
const MIRI: [(&str, &str, u32); 7] = [
    ("letters", "-p sched-dag --test it -- letters", 4),
    (
        "cells",
        "-p fass --lib -- cell::tests latest log wire tape",
        16,
    ),
    (
        "threads",
        "-p linux --lib -- worker office look_out lock::tests::one",
        64,
    ),
    ("spin lock", "-p executive --lib -- spinlock", 16),
    (
        "outbox and others",
        "-p fass -p recording --lib -- outbox edge",
        1,
    ),
    ("steps", "-p linux --lib -- state", 1),
    (
        "executive",
        "-p executive --lib -- accusation agreement console",
        1,
    ),
];

/// The tests that ThreadSanitizer runs.
const THREADS: [(&str, &str); 2] = [
    ("runs", "-p linux --lib --test it --test random"),
    ("edges", "-p fass --lib"),
];

/// Runs the tests whose names are wanted under Miri.
pub(super) fn run_miri(plan: &TestPlan, tally: &mut Tally) -> Result<(), String> {
    ensure("miri")?;
    for (name, words, seeds) in MIRI {
        // Tests read files of the tree, and the time.
        let mut flags = String::from("-Zmiri-disable-isolation");
        if seeds > 1 {
            flags += &format!(" -Zmiri-many-seeds=0..{seeds}");
        }
        let mut command = nightly(&format!("cargo miri test --quiet {words}"));
        command.env("MIRIFLAGS", flags);
        run(plan, &format!("miri: {name}"), command, tally);
    }
    Ok(())
}

/// Runs the tests whose names are wanted under ThreadSanitizer.
pub(super) fn run_thread_sanitizer(plan: &TestPlan, tally: &mut Tally) -> Result<(), String> {
    ensure("rust-src")?;
    // The standard library is compiled anew, as a sanitizer has to see its accesses, too. Tests
    // unwind: with a profile that aborts there would be two of `core`.
    let all = "cargo test --quiet -Zbuild-std --target x86_64-unknown-linux-gnu \
               --config profile.dev.panic='unwind'";
    for (name, words) in THREADS {
        let mut command = nightly(&format!("{all} {words}"));
        command.env("RUSTFLAGS", "-Zsanitizer=thread");
        run(plan, &format!("thread sanitizer: {name}"), command, tally);
    }
    Ok(())
}

fn run(plan: &TestPlan, name: &str, command: Command, tally: &mut Tally) {
    if plan.wants(name) {
        println!("{name}: compiling and running");
        libtest::run(plan, name, command, tally);
    }
}

/// Returns a command of the nightly toolchain.
fn nightly(words: &str) -> Command {
    let mut command = Command::new("rustup");
    command.current_dir(system::workspace());
    command.args(["run", "nightly"]);
    command.args(words.split_whitespace());
    command
}

/// Sees to it that the nightly toolchain is there with a component.
fn ensure(component: &str) -> Result<(), String> {
    let mut listed = Command::new("rustup");
    listed.args(["component", "list", "--installed", "--toolchain=nightly"]);
    let listed = listed.output().map(|said| said.stdout).unwrap_or_default();
    let listed = String::from_utf8_lossy(&listed);
    match listed.lines().any(|line| line.starts_with(component)) {
        true => Ok(()),
        false => Err(format!(
            "there is no nightly toolchain with {component}; `rustup toolchain install nightly \
             --component {component}` installs it"
        )),
    }
}
