//! A set of small numbers whose least one is found at once.
//!
//! One bit a number, and above each level of words another one with a bit for
//! each word that is not empty: for up to 4,096 numbers that makes two levels,
//! for 262,144 three. (An array of such levels is van Emde Boas's idea with
//! 64-way branching; Mehlhorn and Sanders, Algorithms and Data Structures,
//! 2008, exercise 5.9.)

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

/// A set of numbers below a limit.
#[derive(Clone, Debug, Hash)]
pub(super) struct BitSet {
    /// The one word of the highest level.
    top: u64,
    /// The levels below it, the highest first; the last one has the numbers
    /// themselves, unless the top does.
    levels: Box<[Box<[u64]>]>,
}

impl BitSet {
    /// Makes an empty set for the numbers `0..limit`.
    #[inline]
    pub(super) fn new(limit: usize) -> Self {
        let mut levels = Vec::new();
        let mut words = limit.div_ceil(64);
        while words > 1 {
            levels.push(vec![0; words].into_boxed_slice());
            words = words.div_ceil(64);
        }
        levels.reverse();
        Self {
            top: 0,
            levels: levels.into_boxed_slice(),
        }
    }

    #[inline]
    pub(super) const fn is_empty(&self) -> bool {
        self.top == 0
    }

    #[inline]
    pub(super) fn insert(&mut self, number: usize) {
        // Mostly one level is below the top, or none.
        if let [level] = &mut *self.levels {
            level[number / 64] |= 1 << (number % 64);
            self.top |= 1 << (number / 64);
            return;
        }
        let mut place = number;
        for level in self.levels.iter_mut().rev() {
            let word = &mut level[place / 64];
            let was_empty = *word == 0;
            *word |= 1 << (place % 64);
            place /= 64;
            // The levels above have the word's bit already.
            if !was_empty {
                return;
            }
        }
        self.top |= 1 << (place % 64);
    }

    #[inline]
    pub(super) fn remove(&mut self, number: usize) {
        let mut place = number;
        for level in self.levels.iter_mut().rev() {
            let word = &mut level[place / 64];
            *word &= !(1 << (place % 64));
            // Others are left in the word, so the levels above keep its bit.
            if *word != 0 {
                return;
            }
            place /= 64;
        }
        self.top &= !(1 << (place % 64));
    }

    /// Takes the least number out.
    #[inline]
    pub(super) fn pop(&mut self) -> Option<usize> {
        if let [level] = &mut *self.levels {
            if self.top == 0 {
                return None;
            }
            let place = self.top.trailing_zeros() as usize;
            let word = &mut level[place];
            let number = place * 64 + word.trailing_zeros() as usize;
            *word &= *word - 1;
            if *word == 0 {
                self.top &= self.top - 1;
            }
            return Some(number);
        }
        self.first().inspect(|&number| self.remove(number))
    }

    /// Returns the least number.
    #[inline]
    pub(super) fn first(&self) -> Option<usize> {
        if self.is_empty() {
            return None;
        }
        let mut place = self.top.trailing_zeros() as usize;
        for level in &self.levels {
            place = place * 64 + level[place].trailing_zeros() as usize;
        }
        Some(place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gives_the_least_number_at_every_size() {
        for limit in [0, 1, 63, 64, 65, 4_096, 4_097, 300_000] {
            let mut set = BitSet::new(limit);
            assert_eq!(set.first(), None, "limit {limit}");
            let numbers: Vec<_> = (0..limit.min(1_000)).map(|n| limit - 1 - n).collect();
            for &number in &numbers {
                set.insert(number);
                set.insert(number);
                assert_eq!(set.first(), Some(number), "limit {limit}");
            }
            let mut popped = set.clone();
            for &number in numbers.iter().rev() {
                assert_eq!(set.first(), Some(number), "limit {limit}");
                set.remove(number);
                set.remove(number);
                assert_eq!(popped.pop(), Some(number), "limit {limit}");
            }
            assert_eq!((set.first(), popped.pop()), (None, None), "limit {limit}");
        }
    }
}
