//! Processors, and how a thread is pinned to one.
//!
//! Pinning needs a system call that the standard library does not offer. Instead of
//! unsafe code the tool `taskset` (util-linux) does it, from outside, once a thread.

use std::fs;
use std::process::{Command, Stdio};

/// Whether a run's workers kept to their processors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pinning {
    /// Each worker had a processor, which no other worker had.
    Pinned,
    /// The host put workers where it wanted, since `taskset` is missing or refused,
    /// or there are fewer processors than workers.
    Free,
}

/// Returns the numbers of the processors that this program may use; empty if the host
/// does not tell.
#[must_use]
pub fn processors() -> Vec<u32> {
    let status = fs::read_to_string("/proc/thread-self/status").unwrap_or_default();
    let list = status
        .lines()
        .find_map(|line| line.strip_prefix("Cpus_allowed_list:"))
        .unwrap_or("");
    list.trim().split(',').flat_map(range).collect()
}

/// Reads `3` or `0-7`.
fn range(text: &str) -> Vec<u32> {
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    match (first.parse(), last.parse()) {
        (Ok(first), Ok(last)) => (first..=last).collect(),
        _ => Vec::new(),
    }
}

/// Pins the calling thread to a processor, and reports whether that went well.
pub(crate) fn pin(processor: u32) -> bool {
    // The link reads `PROCESS/task/THREAD`.
    let Ok(link) = fs::read_link("/proc/thread-self") else {
        return false;
    };
    let Some(thread) = link.file_name() else {
        return false;
    };
    let status = Command::new("taskset")
        .arg("-pc")
        .arg(processor.to_string())
        .arg(thread)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    status.is_ok_and(|status| status.success())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_lists_as_the_host_writes_them() {
        assert_eq!(range("3"), [3]);
        assert_eq!(range("0-2"), [0, 1, 2]);
        assert_eq!(range(""), []);
    }
}
