//! Signals by which a person, or a service manager, asks a program to end: SIGINT, which ctrl-C
//! sends, and SIGTERM. While they are caught they kill nobody and are counted, so that what goes
//! on can end in order.

use std::sync::atomic::Ordering;

use crate::sys::{self, Catch};

/// The signals, caught as long as this value lives. A program has one at a time.
///
/// ```
/// let signals = linux::EndSignals::catch();
/// linux::EndSignals::send(std::process::id());
/// while signals.count() == 0 {}
/// assert_eq!(signals.count(), 1);
/// ```
#[derive(Debug)]
pub struct EndSignals(());

impl EndSignals {
    /// Has all of them counted from now on.
    #[must_use = "they are caught as long as the value lives"]
    pub fn catch() -> Self {
        Self::begin(Catch::All)
    }

    /// Has the first one counted. The next one ends the program, as it usually does.
    #[must_use = "it is caught as long as the value lives"]
    pub fn catch_first() -> Self {
        Self::begin(Catch::First)
    }

    fn begin(catch: Catch) -> Self {
        sys::ENDS_ASKED.store(0, Ordering::Relaxed);
        sys::catch_ends(catch);
        Self(())
    }

    /// Returns how many have come.
    #[must_use]
    pub fn count(&self) -> u32 {
        sys::ENDS_ASKED.load(Ordering::Acquire)
    }

    /// Sends a process SIGINT. Whether it is still there does not matter.
    pub fn send(process: u32) {
        sys::ask_to_end(process);
    }
}

impl Drop for EndSignals {
    fn drop(&mut self) {
        sys::catch_ends(Catch::None);
    }
}

/// Waits for the first that is caught, until a time at most, and reports whether it has come.
pub(crate) fn wait(until_ns: u64) -> bool {
    sys::wait(&sys::ENDS_ASKED, 0, Some(until_ns));
    sys::ENDS_ASKED.load(Ordering::Acquire) > 0
}
