//! What holds of every boot from a stick, whatever loads the image.

use std::fs;

use tool::protocol::Status;
use tool::qemu::Loader;
use tool::system;

use crate::Guest;

/// Boots the demo and checks that words, processors and memory came through the loader.
///
/// # Panics
///
/// Panics if they did not.
pub fn boots(loader: Loader, cores: u64, memory_mib: u64) {
    let guest = Guest::new("fork-join").from_stick(loader).cores(cores);
    let guest = guest
        .memory_mib(memory_mib)
        .word("jobs=3")
        .word("subtasks=2");
    let outcome = guest.succeed();
    let boots: Vec<_> = outcome.transcript.of_kind("boot").collect();
    assert_eq!(boots.len(), 1, "one boot line is due\n{}", outcome.tail());
    let boot = boots[0];
    assert_eq!(boot.number_at("cpus"), Some(cores), "{}", boot.text);
    let words = "mode=threads budget_factor=0 jobs=3 subtasks=2";
    assert_eq!(boot.text_at("command_line"), Some(words));
    let memory_kib = boot.number_at("memory_kib").expect("the protocol has it");
    assert!(memory_kib <= memory_mib << 10, "{}", boot.text);
    assert!(memory_kib > (memory_mib << 10) / 10 * 9, "{}", boot.text);
    let run = outcome.transcript.of_kind("fork_join").next();
    assert_eq!(run.and_then(|line| line.number_at("joins")), Some(3));
}

/// Boots an app that shows how the file begins that the loader has left in memory.
///
/// # Panics
///
/// Panics if it is another file.
pub fn hands_over_a_file(loader: Loader) {
    let file = system::new_log("module").expect("a folder for logs");
    let mut content = vec![b'z'; 100_001];
    content[..2].copy_from_slice(b"xy");
    fs::write(&file, content).expect("a file in it");
    let guest = Guest::new("replay").from_stick(loader).module(&file);
    let outcome = guest.end_in(Status::Usage);
    let reason = outcome.transcript.verdict().expect("checked before").reason;
    assert!(reason.contains("found `xyz"), "{reason}");
    fs::remove_file(&file).expect("it is ours");
}
