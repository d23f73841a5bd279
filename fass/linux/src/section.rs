//! Sections of locks, which exclude each other by a mutex and a condition variable.
//!
//! Their holder can be preempted. It then has its core when nothing else has, and gives the lock back.

use std::cell::Cell;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use fass::platform::LockWords;

use crate::sys;

/// Taken by a thread that reads or changes a lock's words.
static WORDS: Mutex<()> = Mutex::new(());
static RELEASED: Condvar = Condvar::new();

thread_local! {
    static IS_IN_SECTION: Cell<bool> = const { Cell::new(false) };
}

/// Waits for a lock, and calls `section` in it. Returns how long that took; `None`, without a call,
/// if the caller is in a section.
pub(crate) fn with(lock: &LockWords, section: &mut dyn FnMut()) -> Option<u64> {
    if IS_IN_SECTION.replace(true) {
        return None;
    }
    let mut words = words();
    while lock.state.load(Relaxed) != 0 {
        words = RELEASED.wait(words).unwrap_or_else(PoisonError::into_inner);
    }
    lock.state.store(1, Relaxed);
    drop(words);
    // A panic ends the section, too.
    let _held = Held(lock);
    let entered_ns = sys::now_ns();
    section();
    Some(sys::now_ns().saturating_sub(entered_ns))
}

fn words() -> MutexGuard<'static, ()> {
    WORDS.lock().unwrap_or_else(PoisonError::into_inner)
}

struct Held<'l>(&'l LockWords);

impl Drop for Held<'_> {
    fn drop(&mut self) {
        let words = words();
        self.0.state.store(0, Relaxed);
        drop(words);
        RELEASED.notify_all();
        IS_IN_SECTION.set(false);
    }
}
