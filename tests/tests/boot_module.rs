//! A file that the loader leaves in memory reaches the app, whatever its size.

use std::fs;

use harness::Guest;
use tool::protocol::Status;
use tool::{Machine, Outcome, system};

const MIB: usize = 1 << 20;

/// Boots the app `replay` with a file of `content`, which it refuses by quoting
/// how it begins.
fn refused(guest: Guest, content: &[u8]) -> Outcome {
    let file = system::new_log("module").expect("a folder for logs");
    fs::write(&file, content).expect("a file in it");
    let outcome = guest.module(&file).end_in(Status::Usage);
    let _ = fs::remove_file(&file);
    let reason = outcome.transcript.verdict().expect("checked before").reason;
    assert!(reason.contains("found `xyz"), "{reason}");
    outcome
}

fn content(bytes: usize) -> Vec<u8> {
    let mut content = vec![b'z'; bytes];
    content[..2].copy_from_slice(b"xy");
    content
}

/// Returns the time from the kernel's entry to its first line.
fn ready_ns(outcome: &Outcome) -> u64 {
    let boot = outcome.transcript.of_kind("boot").next();
    let ready_ns = boot.and_then(|line| line.number_at("ready_ns"));
    ready_ns.expect("the protocol has it")
}

#[test]
fn the_boot_takes_no_longer_with_a_large_file() {
    let small = ready_ns(&refused(Guest::new("replay"), &content(3)));
    let large = ready_ns(&refused(Guest::new("replay"), &content(20 * MIB + 1)));
    let difference = small.abs_diff(large);
    assert!(difference < small / 100, "{small} ns, {large} ns");
}

#[test]
fn a_file_reaches_the_app_on_both_boards() {
    for machine in [Machine::Microvm, Machine::Q35] {
        for bytes in [4095, 4096, 4097, 3 * MIB + 5] {
            refused(Guest::new("replay").machine(machine), &content(bytes));
        }
    }
}

#[test]
fn an_app_that_takes_no_file_is_warned_of() {
    let file = system::new_log("module").expect("a folder for logs");
    fs::write(&file, "a recording").expect("a file in it");
    let few = || Guest::new("fork-join").word("jobs=1");
    let said = |outcome: Outcome| outcome.serial.contains("warning: the app takes no file");
    assert!(said(few().module(&file).succeed()));
    assert!(!said(few().succeed()));
    let _ = fs::remove_file(&file);
}
