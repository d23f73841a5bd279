//! The signals by which a person, or a service manager, asks a program of Linux to end.
//!
//! SIGINT, which ctrl-C sends, and SIGTERM kill nobody while they are caught. They are counted, so
//! that the program can end in order. A thread can wait for them, by a futex; `linux` has all its
//! waits by the same two calls, [`wait`] and [`wake`].

#![deny(unsafe_code)]

#[allow(unsafe_code, reason = "system calls that std does not offer")]
mod sys;

use std::sync::atomic::Ordering;

use sys::{Catch, ENDS_ASKED};

pub use sys::{wait, wake};

/// The signals, caught as long as this value lives. A program has one at a time.
///
/// ```
/// use end_signals::EndSignals;
///
/// let signals = EndSignals::catch();
/// EndSignals::send(std::process::id());
/// while signals.count() == 0 {}
/// assert_eq!(signals.count(), 1);
/// ```
#[derive(Debug)]
pub struct EndSignals(());

impl EndSignals {
    /// Has all of them counted from now on.
    #[must_use = "they are caught as long as the value lives"]
    pub fn catch() -> Self {
        Self::new(Catch::All)
    }

    /// Has the first one counted. The next one ends the program, as it usually does.
    #[must_use = "it is caught as long as the value lives"]
    pub fn catch_first() -> Self {
        Self::new(Catch::First)
    }

    fn new(catch: Catch) -> Self {
        ENDS_ASKED.store(0, Ordering::Relaxed);
        sys::catch_ends(catch);
        Self(())
    }

    /// Returns how many have come.
    pub fn count(&self) -> u32 {
        ENDS_ASKED.load(Ordering::Acquire)
    }

    /// Sends a process SIGINT. Whether it is still there does not matter.
    pub fn send(process: u32) {
        sys::ask_to_end(process);
    }

    /// Waits for the first that is caught, until a time at most on the clock that never jumps, and
    /// reports whether it has come.
    pub fn wait(until_ns: u64) -> bool {
        wait(&ENDS_ASKED, 0, Some(until_ns));
        ENDS_ASKED.load(Ordering::Acquire) > 0
    }
}

impl Drop for EndSignals {
    fn drop(&mut self) {
        sys::catch_ends(Catch::None);
    }
}
