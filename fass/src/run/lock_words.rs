//! The words of a lock, by which platforms keep its sections apart.

use core::sync::atomic::{AtomicU32, AtomicU64};

/// The words by which a platform keeps the sections of a lock apart; 0 in a lock that nobody has or
/// wants. See [`Platform::section`](crate::platform::Platform::section).
#[derive(Debug)]
pub struct LockWords {
    /// Whether somebody is in a section, and more that the platform knows, such as whose turn is next.
    pub state: AtomicU32,
    /// The cores that wait, as bits.
    pub waiting: [AtomicU64; 4],
}
