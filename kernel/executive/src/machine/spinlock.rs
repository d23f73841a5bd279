//! A lock for data shared by interrupt handlers and all other code.
//!
//! The holder runs with interrupts disabled on its core: otherwise a handler waiting for the lock
//! could wait for the very code it interrupted. A lock is therefore held for a bounded, short time
//! and never across an app's function.
//!
//! Tickets make the lock fair: with m cores, a core waits for at most m - 1 others.

use core::cell::UnsafeCell;
use core::ops::{Deref, DerefMut};
use core::sync::atomic::{AtomicU32, Ordering};

use super::{cpu, interrupt_flag};

/// Data for use by one core at a time, with interrupts disabled.
///
/// **Ticket invariant**: exactly one ticket equals `serving`; its holder alone touches `data`, from
/// taking the ticket's turn until serving the next.
pub struct SpinLock<T> {
    next: AtomicU32,
    serving: AtomicU32,
    data: UnsafeCell<T>,
}

// SAFETY: by the ticket invariant one core at a time reaches the data, so
// sharing the lock moves the data between cores, for which `T: Send` suffices.
unsafe impl<T: Send> Sync for SpinLock<T> {}

/// Access to the data of a [`SpinLock`], until dropped.
pub struct SpinLockGuard<'a, T> {
    lock: &'a SpinLock<T>,
    interrupts_were_enabled: bool,
    /// The interrupt flag belongs to the core, so the guard must be dropped where it was made.
    _not_send: core::marker::PhantomData<*const ()>,
}

impl<T> SpinLock<T> {
    /// Creates an unlocked lock.
    pub const fn new(data: T) -> Self {
        Self {
            next: AtomicU32::new(0),
            serving: AtomicU32::new(0),
            data: UnsafeCell::new(data),
        }
    }

    /// Waits until the data is free and takes the data.
    ///
    /// Must not be called by the holder, who would wait forever.
    #[track_caller]
    pub fn lock(&self) -> SpinLockGuard<'_, T> {
        // Before a ticket is drawn: a handler waiting behind this ticket would wait forever.
        let interrupts_were_enabled = interrupt_flag::disable();
        let mut guard = self.lock_uninterrupted();
        guard.interrupts_were_enabled = interrupts_were_enabled;
        guard
    }

    /// Takes the data like [`lock`](Self::lock), with interrupts already disabled, and leaves them
    /// so.
    pub fn lock_uninterrupted(&self) -> SpinLockGuard<'_, T> {
        // Relaxed: the ticket orders nothing but the queue; the acquire load below orders the data.
        let ticket = self.next.fetch_add(1, Ordering::Relaxed);
        while self.serving.load(Ordering::Acquire) != ticket {
            cpu::relax();
        }
        self.guard(false)
    }

    /// Takes the data if free.
    #[track_caller]
    pub fn try_lock(&self) -> Option<SpinLockGuard<'_, T>> {
        let interrupts_were_enabled = interrupt_flag::disable();
        let serving = self.serving.load(Ordering::Acquire);
        // Takes a ticket only if it is served at once: a ticket once drawn has to be waited for.
        let taken = self
            .next
            .compare_exchange(
                serving,
                serving.wrapping_add(1),
                Ordering::Relaxed,
                Ordering::Relaxed,
            )
            .is_ok();
        if taken {
            return Some(self.guard(interrupts_were_enabled));
        }
        interrupt_flag::restore(interrupts_were_enabled);
        None
    }

    /// Returns how often the data has been taken, modulo 2^32: the number of tickets given out.
    pub fn acquisitions(&self) -> u32 {
        self.next.load(Ordering::Relaxed)
    }

    const fn guard(&self, interrupts_were_enabled: bool) -> SpinLockGuard<'_, T> {
        SpinLockGuard {
            lock: self,
            interrupts_were_enabled,
            _not_send: core::marker::PhantomData,
        }
    }
}

impl<T> Deref for SpinLockGuard<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        // SAFETY: the guard holds the served ticket (ticket invariant).
        unsafe { &*self.lock.data.get() }
    }
}

impl<T> DerefMut for SpinLockGuard<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        // SAFETY: the guard holds the served ticket (ticket invariant), and
        // `&mut self` makes this the only reference from it.
        unsafe { &mut *self.lock.data.get() }
    }
}

impl<T> Drop for SpinLockGuard<'_, T> {
    fn drop(&mut self) {
        // Relaxed: only the holder changes the number served.
        let serving = self.lock.serving.load(Ordering::Relaxed);
        self.lock
            .serving
            .store(serving.wrapping_add(1), Ordering::Release);
        interrupt_flag::restore(self.interrupts_were_enabled);
    }
}

#[cfg(test)]
mod tests {
    use super::SpinLock;

    /// By the way that leaves interrupts alone, which a program of the host may not touch.
    #[test]
    fn one_core_at_a_time_has_the_data_and_sees_all_changes() {
        let rounds = if cfg!(miri) { 20 } else { 200 };
        let lock = SpinLock::new([0_u64; 2]);
        let add = || {
            for _ in 0..rounds {
                let mut data = lock.lock_uninterrupted();
                let [first, second] = *data;
                assert_eq!(first, second);
                *data = [first + 1, second + 1];
            }
        };
        std::thread::scope(|scope| {
            scope.spawn(add);
            scope.spawn(add);
            add();
        });
        assert_eq!(*lock.lock_uninterrupted(), [3 * rounds; 2]);
        assert_eq!(u64::from(lock.acquisitions()), 3 * rounds + 1);
    }
}
