//! QEMU with other words than the tool's: other processors, boards and devices.

use std::fs;
use std::os::unix::fs::PermissionsExt;

use crate::file::File;

/// Makes a script running QEMU with other words in place of ours, and with more words added.
pub(crate) fn altered(changes: &[(&str, &str)], more: &str) -> File {
    let change = |(other, word): &(&str, &str)| format!("set -- \"${{@/{other}/{word}}}\"\n");
    let changes: String = changes.iter().map(change).collect();
    let script = format!("#!/bin/bash\n{changes}exec qemu-system-x86_64 \"$@\" {more}\n");
    let program = File::of("altered", "sh", script);
    fs::set_permissions(&program.0, fs::Permissions::from_mode(0o755)).expect("it is ours");
    program
}
