//! Checks of every boot from a stick, by any loader.

use tool::qemu::Loader;

use crate::file::File;
use crate::{Guest, Members, Said};

/// Boots the demo and checks the words, processors and memory passed on by the loader.
///
/// # Panics
///
/// Panics if they differ from the given values.
pub fn boots(loader: Loader, cores: u64, memory_mib: u64) {
    let guest = Guest::new("fork-join").from_stick(loader).cores(cores);
    let guest = guest.memory_mib(memory_mib).word("jobs=3 subtasks=2");
    let outcome = guest.succeed();
    let boot = outcome.only("boot");
    boot.has([("cpus", cores)]);
    let words = "mode=threads budget_factor=0 jobs=3 subtasks=2";
    boot.reads([("command_line", words)]);
    let memory_kib = boot.number("memory_kib");
    assert!(memory_kib <= memory_mib << 10, "{}", boot.text);
    assert!(memory_kib > (memory_mib << 10) / 10 * 9, "{}", boot.text);
    outcome.line("fork_join").has([("joins", 3)]);
}

/// Boots an app showing the first bytes of the file left in memory by the loader.
///
/// # Panics
///
/// Panics if another file was left.
pub fn hands_over_a_file(loader: Loader) {
    let mut content = vec![b'z'; 100_001];
    content[..2].copy_from_slice(b"xy");
    let file = File::of("module", "file", content);
    let guest = Guest::new("dag-file").from_stick(loader).module(&file.0);
    let reason = guest.refusal();
    assert!(reason.contains("found `xyz"), "{reason}");
}
