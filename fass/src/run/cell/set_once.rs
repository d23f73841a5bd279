//! The set-once: a value that is given later, such as the platform. It is empty, then set for good.
//!
//! > **Set-once invariant.** The caller that moves the state from `EMPTY` to
//! > `WRITING` is the only one that ever writes the value, and does so before it stores
//! > `SET` with `Release`. After `SET` nobody writes. Readers read only after
//! > an `Acquire` load gave `SET`.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicU8, Ordering};

const EMPTY: u8 = 0;
const WRITING: u8 = 1;
const SET: u8 = 2;

/// A value that is set at most once and then read by everybody.
///
/// ```
/// static PLACE: fass::SetOnce<u32> = fass::SetOnce::new();
/// assert_eq!(PLACE.get(), None);
/// assert!(PLACE.set(1) && !PLACE.set(2));
/// assert_eq!(PLACE.get(), Some(&1));
/// ```
#[derive(Debug)]
pub struct SetOnce<T> {
    state: AtomicU8,
    value: UnsafeCell<MaybeUninit<T>>,
}

// SAFETY: by the set-once invariant the value is written by one thread before
// any thread reads it. `T: Send` as the owner drops it, `T: Sync` as all look at it.
unsafe impl<T: Send + Sync> Sync for SetOnce<T> {}

impl<T> SetOnce<T> {
    /// Makes an empty place.
    #[must_use]
    #[allow(clippy::new_without_default, reason = "it is for statics")]
    pub const fn new() -> Self {
        Self {
            state: AtomicU8::new(EMPTY),
            value: UnsafeCell::new(MaybeUninit::uninit()),
        }
    }

    /// Sets the value, and reports whether this call was the one that did.
    pub fn set(&self, value: T) -> bool {
        let claim =
            self.state
                .compare_exchange(EMPTY, WRITING, Ordering::Relaxed, Ordering::Relaxed);
        if claim.is_err() {
            return false;
        }
        let place = self.value.get().cast::<T>();
        // SAFETY: we moved the state from `EMPTY` to `WRITING`, so by the
        // set-once invariant we alone may write, and nobody reads yet.
        unsafe { place.write(value) };
        self.state.store(SET, Ordering::Release);
        true
    }

    /// Returns the value, or `None` while none is set.
    #[inline]
    pub fn get(&self) -> Option<&T> {
        if self.state.load(Ordering::Acquire) != SET {
            return None;
        }
        let place = self.value.get().cast::<T>();
        // SAFETY: the state is `SET`, so by the set-once invariant the value is
        // initialised and no longer written, as long as this borrow of the cell lasts.
        Some(unsafe { &*place })
    }
}

impl<T> Drop for SetOnce<T> {
    fn drop(&mut self) {
        if *self.state.get_mut() == SET {
            // SAFETY: by the set-once invariant it is initialised, and `&mut self` is alone.
            unsafe { self.value.get_mut().assume_init_drop() };
        }
    }
}
