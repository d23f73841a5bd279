//! A reference to something that lasts for ever, which another one may take the place of.

use core::ptr;
use core::sync::atomic::{AtomicPtr, Ordering};

/// Which of several values is current. Reading it is a load.
///
/// > **Current invariant.** The pointer always comes from a `&'static T`.
pub(crate) struct Current<T: 'static>(AtomicPtr<T>);

impl<T: Sync> Current<T> {
    pub(crate) const fn new(first: &'static T) -> Self {
        Self(AtomicPtr::new(ptr::from_ref(first).cast_mut()))
    }

    pub(crate) fn set(&self, next: &'static T) {
        let next = ptr::from_ref(next).cast_mut();
        self.0.store(next, Ordering::Release);
    }

    #[inline]
    pub(crate) fn get(&self) -> &'static T {
        let current = self.0.load(Ordering::Acquire);
        // SAFETY: by the current invariant it is valid, and only looked at, for ever.
        unsafe { &*current }
    }
}

#[cfg(test)]
mod tests {
    use super::Current;

    #[test]
    fn the_last_one_that_was_set_counts() {
        static CURRENT: Current<u32> = Current::new(&1);
        assert_eq!(*CURRENT.get(), 1);
        CURRENT.set(&2);
        assert_eq!(*CURRENT.get(), 2);
    }
}
