//! The image boots from a stick, as on a PC: by GRUB, under a BIOS and under UEFI.

use std::fs;
use std::time::Duration;

use harness::Guest;
use harness::altered::qemu_and;
use harness::stick::{self, boots};
use tool::Outcome;
use tool::qemu::{Ending, Loader};

#[test]
fn two_processors_by_a_bios() {
    boots(Loader::Bios, 2, 32);
}

#[test]
fn four_processors_by_a_bios_with_memory_beyond_4_gib() {
    boots(Loader::Bios, 4, 6 << 10);
}

#[test]
fn two_processors_by_uefi() {
    boots(Loader::Uefi, 2, 128);
}

#[test]
fn four_processors_by_uefi() {
    boots(Loader::Uefi, 4, 256);
}

/// Under UEFI it lies below 1 MiB, and never at 0, where the firmware reads nothing to.
#[test]
fn a_file_on_the_stick_reaches_the_app_by_both() {
    stick::hands_over_a_file(Loader::Bios);
    stick::hands_over_a_file(Loader::Uefi);
}

/// GRUB stays with its line, so the run ends by its limit, which a busy host may need more of.
#[test]
fn a_processor_without_64_bits_is_refused_by_grub() {
    // Without a screen the BIOS shows letters at the serial port.
    let changes = [("#max", "qemu32"), ("#q35", "q35,graphics=off")];
    let program = qemu_and(&changes, "");
    let guest = Guest::new("fork-join").from_stick(Loader::Bios);
    let guest = guest.program(&program);
    let line = "this processor has no 64-bit mode, which the image needs";
    let says = |outcome: &Outcome| letters(&outcome.serial).contains(line);
    let mut outcome = guest.clone().limit(Duration::from_secs(8)).boot();
    for seconds in [60, 600] {
        if says(&outcome) {
            break;
        }
        outcome = guest.clone().limit(Duration::from_secs(seconds)).boot();
    }
    fs::remove_file(&program).expect("it is ours");
    assert!(says(&outcome), "{}", outcome.tail());
    let waited = matches!(outcome.ending, Ending::TimedOut { .. });
    assert!(waited, "{}\n{}", outcome.ending, outcome.tail());
}

/// Returns what is shown, without what moves the cursor: the BIOS may do that in mid-word.
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
