//! The signals with which a person, or a service manager, asks a Linux program to end.
//!
//! SIGINT, sent by ctrl-C, and SIGTERM kill nobody while they are caught. The crate counts them, so
//! the program can end in order. A thread can wait for a signal, by a futex. The crate `linux`
//! makes all its waits with the same two calls, [`wait`] and [`wake`].

#![deny(unsafe_code)]

#[allow(unsafe_code, reason = "system calls that std does not offer")]
mod sys;

use std::sync::atomic::Ordering;

use sys::{Catch, ENDS_ASKED};

pub use sys::{wait, wake};

/// The signals, caught as long as this value lives. A program has one such value at a time.
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
    /// Counts every SIGINT and SIGTERM from now on.
    #[must_use = "they are caught as long as the value lives"]
    pub fn catch() -> Self {
        Self::new(Catch::All)
    }

    /// Counts the first signal. The next signal ends the program, as usual.
    #[must_use = "it is caught as long as the value lives"]
    pub fn catch_first() -> Self {
        Self::new(Catch::First)
    }

    fn new(catch: Catch) -> Self {
        ENDS_ASKED.store(0, Ordering::Relaxed);
        sys::catch_ends(catch);
        Self(())
    }

    /// Returns how many signals have come.
    pub fn count(&self) -> u32 {
        ENDS_ASKED.load(Ordering::Acquire)
    }

    /// Sends a process SIGINT. The process need not exist any more.
    pub fn send(process: u32) {
        sys::ask_to_end(process);
    }

    /// Waits for the first caught signal, at most until a time on the monotonic clock, and reports
    /// whether a signal has come.
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
