//! The image boots from a FAT stick under UEFI without GRUB, by an application of our own.

use std::fs;

use harness::Guest;
use harness::stick::{boots, hands_over_a_file};
use tool::protocol::Status;
use tool::qemu::{Ending, Loader};
use tool::system;
use tool::tiny::{TinyEnd, tiny_image};

#[test]
fn two_processors_and_four_with_memory_beyond_4_gib() {
    boots(Loader::Efi, 2, 128);
    boots(Loader::Efi, 4, 6 << 10);
}

#[test]
fn a_file_on_the_stick_reaches_the_app() {
    hands_over_a_file(Loader::Efi);
}

/// The image belongs where there is no memory, and nothing is written there.
#[test]
fn memory_that_is_not_free_is_refused_on_the_firmwares_console() {
    let mut image = tiny_image("never entered", TinyEnd::Exit(0x10));
    image[64 + 24..64 + 32].copy_from_slice(&(1_u64 << 40).to_le_bytes());
    let file = system::new_log("image").expect("a folder for logs");
    fs::write(&file, image).expect("a file in it");
    let outcome = Guest::new("image")
        .image(&file)
        .from_stick(Loader::Efi)
        .boot();
    fs::remove_file(&file).expect("it is ours");
    assert_eq!(outcome.ending, Ending::Guest(Status::Failure));
    let line = "the memory where the image belongs, from 2 MiB on, is not free: use an ISO";
    assert!(outcome.serial.contains(line), "{}", outcome.tail());
    assert!(!outcome.serial.contains("never entered"));
}
