//! A set of cores that have to be told something.

use crate::machine::this_core;

/// Some of the cores, as bits.
#[derive(Debug, Default)]
pub(super) struct CoreSet([u64; 4]);

impl CoreSet {
    pub(super) fn insert(&mut self, core: u32) {
        self.0[(core / 64) as usize] |= 1 << (core % 64);
    }

    /// Makes each of the cores look for work.
    #[inline]
    pub(super) fn wake(&self) {
        // Mostly nobody is to be told.
        if self.0.iter().fold(0, |all, word| all | word) != 0 {
            self.wake_some();
        }
    }

    #[inline(never)]
    fn wake_some(&self) {
        for (word, first) in self.0.iter().zip((0..).step_by(64)) {
            let mut left = *word;
            while left != 0 {
                this_core::all()[first + left.trailing_zeros() as usize].wake_up();
                left &= left - 1;
            }
        }
    }
}
