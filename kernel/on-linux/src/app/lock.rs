//! A lock for what instances of an app share: the kernel's, by a mutex.
//!
//! Its holder can be preempted. It then has its core when nothing else has, and gives the lock
//! back.

use std::sync::{Mutex, MutexGuard};
use std::thread::{self, ThreadId};

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
