//! `--miri` and `--thread-sanitizer`: tests under tools that watch how threads interact.
//!
//! Both tools come only with a nightly toolchain of Rust. So they run on request, and nothing
//! depends on them. Miri executes every access by the rules of the language, and returns an
//! atomic's old values where the rules allow; many *seeds* give as many interleavings. Miri is
//! slow, so counts shrink under `cfg!(miri)`, and supports neither assembly nor Linux' scheduling
//! calls. ThreadSanitizer sees data races in whole runs on Linux' threads, in the interleavings
//! that happen to occur.

use std::process::Command;

use super::{Tally, TestPlan, libtest};
use tool::system;

/// The groups of tests under Miri: a name, cargo's words, and the number of seeds. Groups with a
/// single seed have a single thread, or are too slow for more.
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

/// The groups of tests under ThreadSanitizer.
const THREADS: [(&str, &str); 2] = [
    ("runs", "-p linux --lib --test it --test random"),
    ("edges", "-p fass --lib"),
];

/// Runs the wanted groups of tests under Miri.
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

/// Runs the wanted groups of tests under ThreadSanitizer.
pub(super) fn run_thread_sanitizer(plan: &TestPlan, tally: &mut Tally) -> Result<(), String> {
    ensure("rust-src")?;
    // The standard library is compiled anew, since the sanitizer has to see its accesses, too.
    // Tests unwind: with an aborting profile, two copies of `core` would be linked.
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

/// Makes sure that the nightly toolchain is there, with a component.
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
