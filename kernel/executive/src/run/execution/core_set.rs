//! A set of cores that have to be told something.

use crate::machine::this_core;

/// Some of the cores, as bits.
#[derive(Debug, Default)]
pub(super) struct CoreSet([u64; 4]);

impl CoreSet {
    pub(super) fn insert(&mut self, core: u32) {
        self.0[(core / 64) as usize] |= 1 << (core % 64);
    }

    pub(super) fn insert_all(&mut self, others: &Self) {
        for (word, others) in self.0.iter_mut().zip(others.0) {
            *word |= others;
        }
    }

    /// Makes each of the cores look for work.
    pub(super) fn wake(&self) {
        for (word, first) in self.0.iter().zip((0..).step_by(64)) {
            let mut left = *word;
            while left != 0 {
                this_core::all()[first + left.trailing_zeros() as usize].wake_up();
                left &= left - 1;
            }
        }
    }
}
