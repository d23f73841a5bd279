//! The words of a lock, with which platforms keep the lock's sections apart.

use core::sync::atomic::{AtomicU32, AtomicU64};

/// The words with which a platform keeps the sections of a lock apart. All are 0 while nobody holds
/// or wants the lock. See [`Platform::section`](crate::platform::Platform::section).
#[derive(Debug)]
pub struct LockWords {
    /// Whether somebody is in a section, with further state of the platform, such as whose turn is
    /// next.
    pub state: AtomicU32,
    /// The waiting cores, as bits.
    pub waiting: [AtomicU64; 4],
}
