//! A lock for what instances of an app share.
//!
//! A DAG needs none: its values move along its edges. This is for what is no DAG,
//! such as the publish/subscribe baseline that DAGs are compared with, where
//! several cores change one state.
//!
//! The holder runs with interrupts off, as with the kernel's own locks, because a
//! holder that were preempted would block every core that wants the lock. So a
//! section delays whatever its core should do next: keep it short and bounded. A
//! panic in a section is the kernel's, not the subtask's: nothing contains it.

use crate::machine::spinlock::SpinLock;

/// Data that one core at a time may use.
///
/// Waiting cores get their turn in the order in which they came.
///
/// ```no_run
/// use kernel::Lock;
///
/// static SEEN: Lock<u64> = Lock::new(0);
///
/// fn saw_one() -> u64 {
///     SEEN.with(|seen| {
///         *seen += 1;
///         *seen
///     })
/// }
/// ```
#[derive(Debug)]
pub struct Lock<T>(SpinLock<T>);

impl<T> Lock<T> {
    /// Makes a lock that is free.
    ///
    /// See [`Lock`].
    #[must_use]
    pub const fn new(data: T) -> Self {
        Self(SpinLock::new(data))
    }

    /// Waits for the data's turn and lends it to `section`.
    ///
    /// A section that takes the same lock again waits forever.
    ///
    /// See [`Lock`].
    #[track_caller]
    pub fn with<R>(&self, section: impl FnOnce(&mut T) -> R) -> R {
        section(&mut self.0.lock())
    }
}
