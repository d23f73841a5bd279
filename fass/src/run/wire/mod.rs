//! What a wire is made of: a ring of packets on their way in, and one of bytes on their way out.
//!
//! A platform is the other side of each: it says what has arrived, and takes what is to go.
//! Both rings are made before the commit, and nothing here allocates, waits or loops without
//! a bound after that.

pub(crate) mod incoming;
pub(crate) mod outgoing;
mod ring;

#[cfg(test)]
mod tests;

use core::sync::atomic::{AtomicU64, Ordering};

/// Counts one side's events; several of them are looked at by another.
#[derive(Default)]
pub(crate) struct Counter(AtomicU64);

impl Counter {
    fn add(&self, count: usize) {
        // One side counts, so a load and a store suffice.
        let before = self.0.load(Ordering::Relaxed);
        self.0.store(before + count as u64, Ordering::Relaxed);
    }

    pub(crate) fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}
