//! The image boots from a stick, as on a PC: by GRUB, under a BIOS and under UEFI.

use harness::stick::{self, boots};
use tool::qemu::Loader;

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

/// Under UEFI it lies below 1 MiB.
#[test]
fn a_file_on_the_stick_reaches_the_app_by_both() {
    stick::hands_over_a_file(Loader::Bios);
    stick::hands_over_a_file(Loader::Uefi);
}
