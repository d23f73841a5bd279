//! QEMU with other words than the tool gives it: other processors, boards and devices.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;

use tool::system;

/// A program that is QEMU with other words in place of ours. It is a script, which is removed
/// with this value.
#[derive(Debug)]
pub(crate) struct Altered(pub(crate) PathBuf);

impl Altered {
    /// Makes one, with words in place of ours, and with these added.
    pub(crate) fn new(changes: &[(&str, &str)], more: &str) -> Altered {
        let program = system::new_log("altered").expect("a file");
        let change = |(other, word): &(&str, &str)| format!("set -- \"${{@/{other}/{word}}}\"\n");
        let changes: String = changes.iter().map(change).collect();
        let script = format!("#!/bin/bash\n{changes}exec qemu-system-x86_64 \"$@\" {more}\n");
        fs::write(&program, script).expect("the script is written");
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).expect("it is ours");
        Altered(program)
    }
}

impl Drop for Altered {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}
