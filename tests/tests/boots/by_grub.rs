//! The image boots from a stick, like on a PC: by GRUB, under a BIOS and under UEFI.

use std::time::Duration;

use harness::Guest;
use harness::stick::{self, boots};
use tool::Outcome;
use tool::qemu::{Loader, RunEnd};

#[test]
fn two_and_four_processors_by_a_bios_and_by_uefi() {
    for (loader, cores, memory_mib) in [
        (Loader::Bios, 2, 32),
        // Memory beyond 4 GiB.
        (Loader::Bios, 4, 6 << 10),
        (Loader::Uefi, 2, 128),
        (Loader::Uefi, 4, 256),
    ] {
        boots(loader, cores, memory_mib);
    }
}

/// Under UEFI the file lies below 1 MiB, and never at 0, because the firmware reads no file there.
#[test]
fn a_file_on_the_stick_reaches_the_app_by_both() {
    stick::hands_over_a_file(Loader::Bios);
    stick::hands_over_a_file(Loader::Uefi);
}

/// GRUB stays with its line, so the run ends by its limit. A busy host may need a longer limit.
#[test]
fn a_processor_without_64_bits_is_refused_by_grub() {
    // Without a screen the BIOS shows letters at the serial port.
    let changes = [("#max", "qemu32"), ("#q35", "q35,graphics=off")];
    let guest = Guest::new("fork-join").from_stick(Loader::Bios);
    let guest = guest.altered(&changes, "");
    let line = "this processor has no 64-bit mode, which the image needs";
    let says = |outcome: &Outcome| letters(&outcome.serial).contains(line);
    let limits = [8, 60, 600].map(Duration::from_secs).into_iter();
    let mut outcomes = limits.map(|limit| guest.clone().limit(limit).boot());
    let outcome = outcomes.find(says).expect("GRUB says so");
    let waited = matches!(outcome.ending, RunEnd::TimedOut { .. });
    assert!(waited, "{}\n{}", outcome.ending, outcome.tail());
}

/// Returns the visible text, without sequences moving the cursor: the BIOS may move the cursor in
/// mid-word.
fn letters(serial: &str) -> String {
    let mut pieces = serial.split("\x1b[");
    let mut letters = String::from(pieces.next().unwrap_or_default());
    for piece in pieces {
        // A sequence ends with its first letter (ECMA-48, 5.4).
        let end = piece.find(|c: char| c.is_ascii_alphabetic());
        letters.push_str(end.map_or("", |end| &piece[end + 1..]));
    }
    letters
}
