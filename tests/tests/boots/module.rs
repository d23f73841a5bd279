//! A file left in memory by the loader reaches the app, whatever its size.

use harness::file::File;
use harness::{Guest, Members, Said};
use tool::{Machine, Outcome};
use views::protocol::Status;

const MIB: usize = 1 << 20;

/// Boots the app `dag-file` with a file of `bytes` bytes. The app refuses the file, and quotes its
/// beginning.
fn refused(guest: Guest, bytes: usize) -> Outcome {
    let mut content = vec![b'z'; bytes];
    content[..2].copy_from_slice(b"xy");
    let file = File::of("module", "file", content);
    let outcome = guest.module(&file.0).end_in(Status::Usage);
    let reason = outcome.reason();
    assert!(reason.contains("found `xyz"), "{reason}");
    outcome
}

/// Compares the times from the kernel's entry to its first line.
#[test]
fn the_boot_takes_no_longer_with_a_large_file() {
    let [small, large] = [3, 20 * MIB + 1].map(|bytes| {
        let outcome = refused(Guest::new("dag-file"), bytes);
        outcome.line("boot").number("ready_ns")
    });
    let difference = small.abs_diff(large);
    assert!(difference < small / 100, "{small} ns, {large} ns");
}

#[test]
fn a_file_reaches_the_app_on_both_boards() {
    for (machine, bytes) in [
        (Machine::Microvm, 4095),
        (Machine::Microvm, 4096),
        (Machine::Microvm, 4097),
        (Machine::Q35, 3 * MIB + 5),
    ] {
        refused(Guest::new("dag-file").machine(machine), bytes);
    }
}

#[test]
fn an_app_that_takes_no_file_is_warned_of() {
    let file = File::of("module", "file", "a recording");
    let few = Guest::new("fork-join").word("jobs=1");
    for (guest, is_warned) in [(few.clone().module(&file.0), true), (few, false)] {
        let said = guest.succeed().serial;
        let warning = "warning: the app takes no file";
        assert_eq!(said.contains(warning), is_warned, "{said}");
    }
}
