//! The lock around a cluster's state.
//!
//! # The owner
//!
//! If a cluster has one core, nothing has a level, and nothing is preempted or has a budget, one
//! thread takes nearly every step. As the lock's *owner*, that thread enters by plain stores: the
//! owner says "inside", and looks whether the lock is wanted. Any other thread takes the *word* of
//! the lock, says that the lock is wanted, and lets Linux make each running thread pass a barrier
//! (`membarrier`). Either the owner was inside before its barrier: then the other thread sees the
//! owner inside, and waits. Or the owner looks after its barrier, sees that the lock is wanted, and
//! takes the word, too.
//!
//! Where threads have levels there is no owner: a thread would wait for an owner whose processor it
//! has taken. If a panic takes the owner away, the other threads only keep paying for the barrier.
//!
//! # Waiting
//!
//! A thread looks for a while, and then sleeps. Where threads poll, each sleep is a short nap, and
//! no thread is woken: leaving the lock takes no locked instruction.

#![allow(unsafe_code, reason = "a lock")]

use std::cell::UnsafeCell;
use std::ops::{Deref, DerefMut};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering, compiler_fence};
use std::thread;
use std::time::Duration;

use crate::sys;

/// How often a thread looks before sleeping.
const LOOKS: u32 = 100;

/// How often a thread looks before a nap, where threads poll.
const LOOKS_POLLING: u32 = 2_000;

/// How long a thread sleeps, where threads poll.
const NAP: Duration = Duration::from_micros(20);

const FREE: u32 = 0;
const TAKEN: u32 = 1;
/// Taken, and a thread may sleep for the lock.
const AWAITED: u32 = 2;

/// A value for one thread at a time.
#[repr(align(128))]
pub(crate) struct Lock<T> {
    word: AtomicU32,
    /// Whether the owner has the lock without the word. Written only by the owner.
    is_inside: AtomicBool,
    /// Whether the owner has to take the word. Written by the thread with the word.
    is_wanted: AtomicBool,
    /// Whether there is an owner. Without an owner, the lock is always wanted.
    is_owned: bool,
    polls: bool,
    value: UnsafeCell<T>,
}

// SAFETY: only a guard reaches the value, and one thread at a time has a guard: the thread with the
// word, while the owner is not inside, or the owner inside, while no thread has the word and has
// seen the owner outside.
unsafe impl<T: Send> Sync for Lock<T> {}

/// The right to the value, until the guard is dropped.
pub(crate) struct Guard<'l, T> {
    lock: &'l Lock<T>,
    /// Whether the thread has the word. The owner may be inside without the word.
    has_word: bool,
}

impl<T> Lock<T> {
    /// Makes a lock, for threads that poll or sleep, with an owner if wanted and supported by the
    /// kernel.
    pub(crate) fn new(value: T, polls: bool, is_owned: bool) -> Self {
        let is_owned = is_owned && sys::register_barrier();
        Self {
            word: AtomicU32::new(FREE),
            is_inside: AtomicBool::new(false),
            is_wanted: AtomicBool::new(!is_owned),
            is_owned,
            polls,
            value: UnsafeCell::new(value),
        }
    }

    /// Waits for the value, as the owner. Only one thread may ever call this.
    #[inline]
    pub(crate) fn enter_as_owner(&self) -> Guard<'_, T> {
        self.is_inside.store(true, Ordering::Relaxed);
        // For the compiler alone. The processor may still load first: that is what the other
        // thread's barrier is for.
        compiler_fence(Ordering::SeqCst);
        // Acquires the writes of a thread that wanted the lock.
        if !self.is_wanted.load(Ordering::Acquire) {
            return self.guard(false);
        }
        // Out again before waiting: the thread that wants the lock waits until the owner is
        // outside.
        self.is_inside.store(false, Ordering::Release);
        self.take_word();
        self.guard(true)
    }

    /// Waits for the value.
    #[inline]
    pub(crate) fn enter(&self) -> Guard<'_, T> {
        self.take_word();
        if self.is_owned {
            self.keep_owner_out();
        }
        self.guard(true)
    }

    const fn guard(&self, has_word: bool) -> Guard<'_, T> {
        let lock = self;
        Guard { lock, has_word }
    }

    /// Makes sure that the owner is not inside, and will not enter. Called with the word.
    #[cold]
    #[inline(never)]
    fn keep_owner_out(&self) {
        self.is_wanted.store(true, Ordering::SeqCst);
        sys::barrier();
        let mut looks = 0;
        while self.is_inside.load(Ordering::Acquire) {
            looks += 1;
            match looks % LOOKS_POLLING {
                // The owner may have lost its processor to this thread.
                0 => thread::sleep(NAP),
                _ => std::hint::spin_loop(),
            }
        }
    }

    #[inline]
    fn take_word(&self) {
        if !self.try_word(TAKEN) {
            self.wait_for_word();
        }
    }

    #[inline]
    fn try_word(&self, taken: u32) -> bool {
        let (won, lost) = (Ordering::Acquire, Ordering::Relaxed);
        let word = &self.word;
        word.compare_exchange(FREE, taken, won, lost).is_ok()
    }

    #[cold]
    #[inline(never)]
    fn wait_for_word(&self) {
        let looks = if self.polls { LOOKS_POLLING } else { LOOKS };
        let mut taken = TAKEN;
        loop {
            for _ in 0..looks {
                // A look before each try: a failing exchange, too, would take the cache line from
                // the holder.
                if self.word.load(Ordering::Relaxed) == FREE && self.try_word(taken) {
                    return;
                }
                std::hint::spin_loop();
            }
            // Where threads poll, the holder wakes nobody.
            if self.polls {
                thread::sleep(NAP);
                continue;
            }
            // After its first sleep the thread cannot know whether another thread sleeps, too.
            taken = AWAITED;
            if self.word.swap(AWAITED, Ordering::Acquire) == FREE {
                return;
            }
            sys::wait(&self.word, AWAITED, None);
        }
    }
}

impl<T> Drop for Guard<'_, T> {
    #[inline]
    fn drop(&mut self) {
        let lock = self.lock;
        if !self.has_word {
            return lock.is_inside.store(false, Ordering::Release);
        }
        if lock.is_owned {
            // Before the word is given back: afterwards, this could undo the next thread's wish.
            lock.is_wanted.store(false, Ordering::Release);
        }
        if lock.polls {
            lock.word.store(FREE, Ordering::Release);
        } else if lock.word.swap(FREE, Ordering::Release) == AWAITED {
            sys::wake(&lock.word, 1);
        }
    }
}

impl<T> Deref for Guard<'_, T> {
    type Target = T;

    #[inline]
    fn deref(&self) -> &T {
        // SAFETY: a guard is the right to the value.
        unsafe { &*self.lock.value.get() }
    }
}

impl<T> DerefMut for Guard<'_, T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut T {
        // SAFETY: a guard is the right to the value, and is borrowed for as long as the value.
        unsafe { &mut *self.lock.value.get() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The owner and two other threads add to two numbers, which differ if two are ever inside.
    #[test]
    fn one_is_inside_at_a_time() {
        let rounds = if cfg!(miri) { 20 } else { 3_000 };
        for (polls, is_owned) in [(true, true), (false, true), (true, false), (false, false)] {
            let lock = Lock::new([0; 2], polls, is_owned);
            let add = |mut numbers: Guard<'_, [u32; 2]>| {
                assert_eq!(numbers[0], numbers[1]);
                numbers[0] += 1;
                std::hint::black_box(&mut numbers)[1] += 1;
            };
            thread::scope(|scope| {
                scope.spawn(|| (0..40 * rounds).for_each(|_| add(lock.enter_as_owner())));
                for _ in 0..2 {
                    scope.spawn(|| (0..2 * rounds).for_each(|_| add(lock.enter())));
                }
            });
            assert_eq!(*lock.enter(), [44 * rounds; 2]);
        }
    }
}
