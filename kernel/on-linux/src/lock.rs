//! A lock for what instances of an app share, by a mutex, and the kernel's event, by a condition
//! variable.
//!
//! Its holder can be preempted. It then has its core when nothing else has, and gives the lock
//! back.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, ThreadId};
use std::time::Duration;

/// Data that one instance at a time may use.
#[derive(Debug)]
pub struct Lock<T> {
    data: Mutex<T>,
    holder: Mutex<Option<ThreadId>>,
}

impl<T> Lock<T> {
    /// Makes a lock that is free.
    #[must_use]
    pub const fn new(data: T) -> Self {
        Self {
            data: Mutex::new(data),
            holder: Mutex::new(None),
        }
    }

    /// Waits until nobody uses the data and lends it to `section`.
    ///
    /// # Panics
    ///
    /// If the caller is in a section of this lock already, or a fault has ended an instance
    /// that was.
    #[track_caller]
    pub fn with<R>(&self, section: impl FnOnce(&mut T) -> R) -> R {
        let me = thread::current().id();
        if *self.holder() == Some(me) {
            panic!(
                "a lock is taken by its holder, which would wait for ever; end the section first"
            )
        }
        let Ok(mut data) = self.data.lock() else {
            panic!("a fault has ended a section of this lock; its data may be half changed")
        };
        *self.holder() = Some(me);
        let result = section(&mut data);
        *self.holder() = None;
        result
    }

    fn holder(&self) -> MutexGuard<'_, Option<ThreadId>> {
        self.holder.lock().expect("nobody panics with it")
    }
}

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
    #[must_use]
    pub const fn new() -> Self {
        Self {
            version: Mutex::new(0),
            changed: Condvar::new(),
        }
    }

    /// Returns how often the event has happened.
    #[must_use]
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
