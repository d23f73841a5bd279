//! The kernel's event, by a condition variable.

use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

/// Something that instances wait for: a count that only goes up, its *version*. A waiter has
/// read the version, then looked for what it wants in vain, and now waits until the version is
/// another one.
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

    /// Raises the version: all that wait go on.
    pub fn notify(&self) {
        let mut version = self.version.lock().unwrap_or_else(PoisonError::into_inner);
        *version += 1;
        drop(version);
        self.changed.notify_all();
    }

    /// Waits until the version is not `seen` or the time is `until_ns`, on the clock of
    /// [`fass::now_ns`]; `u64::MAX` is never.
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
