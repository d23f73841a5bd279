//! A set of small numbers with fast access to the least number.
//!
//! Each number has a bit, and above each level of words is another level with a bit for each word
//! that is not empty: for up to 4,096 numbers there are two levels, for 262,144 three. (An array of
//! such levels is van Emde Boas's idea with 64-way branching; Mehlhorn and Sanders, Algorithms and
//! Data Structures, 2008, exercise 5.9.)

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

/// A set of numbers below a limit.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct BitSet {
    /// The single word of the highest level.
    top: u64,
    /// The numbers themselves.
    words: Box<[u64]>,
    /// The levels in between, the lowest first; mostly none.
    between: Box<[Box<[u64]>]>,
}

impl BitSet {
    /// Makes an empty set for the numbers `0..limit`.
    #[inline]
    pub(super) fn new(limit: usize) -> Self {
        let mut between = Vec::new();
        let count = limit.div_ceil(64);
        let mut above = count.div_ceil(64);
        // The level of a single word is `top`, in the set itself.
        while above > 1 {
            between.push(vec![0; above].into_boxed_slice());
            above = above.div_ceil(64);
        }
        Self {
            top: 0,
            words: vec![0; count].into_boxed_slice(),
            between: between.into_boxed_slice(),
        }
    }

    #[inline]
    pub(super) const fn is_empty(&self) -> bool {
        self.top == 0
    }

    #[inline(always)]
    pub(super) fn insert(&mut self, number: usize) {
        let mut place = number / 64;
        self.words[place] |= 1 << (number % 64);
        if !self.between.is_empty() {
            place = self.insert_between(place);
        }
        self.top |= 1 << place;
    }

    #[cold]
    fn insert_between(&mut self, mut place: usize) -> usize {
        for level in &mut self.between {
            level[place / 64] |= 1 << (place % 64);
            place /= 64;
        }
        place
    }

    #[inline]
    pub(super) fn remove(&mut self, number: usize) {
        let mut place = number / 64;
        let word = &mut self.words[place];
        *word &= !(1 << (number % 64));
        // Other numbers are left in the word, so the levels above keep its bit.
        if *word != 0 {
            return;
        }
        for level in &mut self.between {
            let word = &mut level[place / 64];
            *word &= !(1 << (place % 64));
            if *word != 0 {
                return;
            }
            place /= 64;
        }
        self.top &= !(1 << (place % 64));
    }

    /// Takes the least number out of a set that is not empty.
    #[inline(always)]
    pub(super) fn pop(&mut self) -> usize {
        let number = self.first();
        let word = &mut self.words[number / 64];
        *word &= word.wrapping_sub(1);
        if *word == 0 {
            // The emptied word was the first, so its bit is the lowest of `top`. A level in between
            // may have other bits left, so there `remove` looks at each.
            match self.between.is_empty() {
                true => self.top &= self.top.wrapping_sub(1),
                false => self.remove(number),
            }
        }
        number
    }

    /// Returns the least number of a set that is not empty.
    #[inline(always)]
    pub(super) fn first(&self) -> usize {
        let mut place = self.top.trailing_zeros() as usize;
        if !self.between.is_empty() {
            place = self.first_between(place);
        }
        place * 64 + self.words[place].trailing_zeros() as usize
    }

    #[cold]
    fn first_between(&self, mut place: usize) -> usize {
        for level in self.between.iter().rev() {
            place = place * 64 + level[place].trailing_zeros() as usize;
        }
        place
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gives_the_least_number_at_every_size() {
        for limit in [0, 1, 63, 64, 65, 4_096, 4_097, 300_000] {
            let mut set = BitSet::new(limit);
            assert!(set.is_empty(), "limit {limit}");
            let numbers: Vec<_> = (0..limit.min(1_000)).map(|n| limit - 1 - n).collect();
            for &number in &numbers {
                set.insert(number);
                set.insert(number);
                assert_eq!(set.first(), number, "limit {limit}");
            }
            let mut popped = set.clone();
            for &number in numbers.iter().rev() {
                assert_eq!(set.first(), number, "limit {limit}");
                set.remove(number);
                set.remove(number);
                assert_eq!(popped.pop(), number, "limit {limit}");
            }
            assert!(set.is_empty() && popped.is_empty(), "limit {limit}");
        }
    }
}
