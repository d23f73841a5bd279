//! A lock for what instances of an app share.
//!
//! A DAG needs none: its values move along its edges. This is for what is no DAG,
//! such as the publish/subscribe baseline that DAGs are compared with, where
//! several cores change one state.
//!
//! The holder is not preempted, or else it would block every core that wants the lock.
//! So a section delays all that its core should do next: keep it short. One that takes
//! longer than 1 ms is preempted all the same.
//!
//! A fault in a section ends the holder's DAG, as anywhere, and the lock is lost with
//! it: the data may be half changed. An instance that waits for it, or takes it later, panics.

use executive::machine::section::{Guarded, Refusal};

/// Data that one instance at a time may use.
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
pub struct Lock<T>(Guarded<T>);

impl<T> Lock<T> {
    /// Makes a lock that is free.
    ///
    /// See [`Lock`].
    #[must_use]
    pub const fn new(data: T) -> Self {
        Self(Guarded::new(data))
    }

    /// Waits until nobody uses the data and lends it to `section`.
    ///
    /// # Panics
    ///
    /// If the caller is in a section of this lock already, or a fault has ended an
    /// instance that was.
    ///
    /// See [`Lock`].
    #[track_caller]
    pub fn with<R>(&self, section: impl FnOnce(&mut T) -> R) -> R {
        match self.0.with(section) {
            Ok(result) => result,
            Err(Refusal::HeldByCaller) => {
                panic!(
                    "a lock is taken by its holder, which would wait for ever; end the section first"
                )
            }
            Err(Refusal::HolderEnded) => {
                panic!("a fault has ended a section of this lock; its data may be half changed")
            }
        }
    }
}
