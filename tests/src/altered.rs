//! QEMU with other words than the tool gives it: other processors, boards and devices. It is
//! a script, which the test removes.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;

use tool::system;

/// Makes a program that is QEMU with another word in place of one of ours.
///
/// # Panics
///
/// Panics if it cannot be written.
#[must_use]
pub fn qemu_with(other: &str, word: &str) -> PathBuf {
    qemu_and(&[(other, word)], "")
}

/// Makes a program that is QEMU with other words in place of ours, and with these added.
///
/// # Panics
///
/// Panics if it cannot be written.
#[must_use]
pub fn qemu_and(changes: &[(&str, &str)], more: &str) -> PathBuf {
    let program = system::new_log("altered").expect("a file");
    let change = |(other, word): &(&str, &str)| format!("set -- \"${{@/{other}/{word}}}\"\n");
    let changes: String = changes.iter().map(change).collect();
    let script = format!("#!/bin/bash\n{changes}exec qemu-system-x86_64 \"$@\" {more}\n");
    fs::write(&program, script).expect("the script is written");
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).expect("it is ours");
    program
}
