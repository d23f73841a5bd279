//! The kernel's event, implemented with a condition variable.

use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

/// An event that instances can wait for: a count that only goes up, its *version*. A waiter reads
/// the version, then looks for its condition. If the condition fails, it waits until the version
/// has changed.
#[derive(Debug, Default)]
pub struct Event {
    version: Mutex<u64>,
    changed: Condvar,
}

impl Event {
    /// Makes an event that has not happened.
    pub const fn new() -> Self {
        Self {
            version: Mutex::new(0),
            changed: Condvar::new(),
        }
    }

    /// Returns how often the event has happened.
    pub fn version(&self) -> u64 {
        *self.version.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Raises the version: all waiters go on.
    pub fn notify(&self) {
        let mut version = self.version.lock().unwrap_or_else(PoisonError::into_inner);
        *version += 1;
        drop(version);
        self.changed.notify_all();
    }

    /// Waits until the version differs from `seen` or the time `until_ns` has come, on the clock of
    /// [`fass::now_ns`]; `u64::MAX` means no limit.
    pub fn wait(&self, seen: u64, until_ns: u64) {
        let mut version = self.version.lock().unwrap_or_else(PoisonError::into_inner);
        while *version == seen {
            let left_ns = until_ns.saturating_sub(fass::now_ns());
            if left_ns == 0 {
                return;
            }
            let left = Duration::from_nanos(left_ns);
            let waited = self.changed.wait_timeout(version, left);
            version = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}
