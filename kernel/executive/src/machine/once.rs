//! A place that is written once, at boot, and read from then on by anyone.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicU8, Ordering};

const EMPTY: u8 = 0;
const WRITING: u8 = 1;
const FULL: u8 = 2;

/// A value that is set at most once.
///
/// **Once invariant**: `value` is written only by the one caller that moved
/// `state` from `EMPTY` to `WRITING`, and is constant once `state` is `FULL`.
#[derive(Debug)]
pub struct Once<T> {
    state: AtomicU8,
    value: UnsafeCell<Option<T>>,
}

// SAFETY: by the once invariant the value moves in from one core and is then
// only shared, for which `T: Send + Sync` suffices.
unsafe impl<T: Send + Sync> Sync for Once<T> {}

impl<T> Once<T> {
    /// Creates an empty place.
    #[allow(clippy::new_without_default, reason = "it is for statics")]
    pub const fn new() -> Self {
        Self {
            state: AtomicU8::new(EMPTY),
            value: UnsafeCell::new(None),
        }
    }

    /// Fills the place, unless it is full, and returns what is in it.
    pub fn set(&self, value: T) -> Result<&T, T> {
        if self
            .state
            .compare_exchange(EMPTY, WRITING, Ordering::Acquire, Ordering::Relaxed)
            .is_err()
        {
            return Err(value);
        }
        // SAFETY: this caller moved the state to WRITING (once invariant).
        let place = unsafe { &mut *self.value.get() };
        let value = place.insert(value);
        self.state.store(FULL, Ordering::Release);
        Ok(value)
    }

    /// Returns the value, if it has been set.
    pub fn get(&self) -> Option<&T> {
        if self.state.load(Ordering::Acquire) != FULL {
            return None;
        }
        // SAFETY: the state is FULL, so nobody writes any more (once invariant).
        unsafe { (*self.value.get()).as_ref() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_the_first_value() {
        let place = Once::new();
        assert_eq!(place.get(), None);
        assert_eq!(place.set(1), Ok(&1));
        assert_eq!(place.set(2), Err(2));
        assert_eq!(place.get(), Some(&1));
    }
}
