//! Random numbers: the same for the same seed, everywhere.
//!
//! The generator is SplitMix64 (Steele, Lea, Flood, OOPSLA 2014, doi 10.1145/2660193.2660195). Its
//! `n`th number is a function of the seed and of `n` alone, and [`nth`] computes the number without
//! its predecessors. So the draws of a job do not depend on which earlier jobs were skipped.
//!
//! [`sets`] draws DAGs.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

pub mod sets;

use core::ops::RangeInclusive;

const INCREMENT: u64 = 0x9e37_79b9_7f4a_7c15;

/// A sequence of random numbers.
#[derive(Clone, Debug)]
pub struct Random {
    state: u64,
}

impl Random {
    /// Starts the sequence of `seed`.
    pub const fn new(seed: u64) -> Self {
        Self { state: seed }
    }

    /// Draws any number.
    pub fn number(&mut self) -> u64 {
        let number = nth(self.state, 0);
        self.state = self.state.wrapping_add(INCREMENT);
        number
    }

    /// Draws a number from `range`, with the same probability for each number; the range has no
    /// number below 0.
    pub fn within<N: Copy + TryFrom<u64> + TryInto<u64>>(&mut self, range: RangeInclusive<N>) -> N {
        scale(self.number(), range)
    }

    /// Draws an index into a list of `length` items, at least one.
    pub fn index(&mut self, length: usize) -> usize {
        self.within(0..=length.saturating_sub(1))
    }

    /// Draws one of some items; at least one is needed.
    pub fn one_of<T: Copy>(&mut self, items: &[T]) -> T {
        items[self.index(items.len())]
    }

    /// Returns `true` once in `count` times on average.
    pub fn once_in(&mut self, count: u64) -> bool {
        self.within(1..=count) == 1
    }

    /// Returns `true` in `percent` of 100 cases on average.
    pub fn chance(&mut self, percent: u64) -> bool {
        self.within(1..=100) <= percent
    }

    /// Draws the edges of a graph. Each edge from a vertex to a later vertex is drawn with a
    /// probability of `percent` in 100.
    pub fn edges(&mut self, vertices: usize, percent: u64) -> impl Iterator<Item = (usize, usize)> {
        let pairs = (1..vertices).flat_map(|to| (0..to).map(move |from| (from, to)));
        pairs.filter(move |_| self.chance(percent))
    }
}

/// Returns number `n` of the sequence of `seed`, counted from 0.
pub const fn nth(seed: u64, n: u64) -> u64 {
    let mut mixed = seed.wrapping_add(INCREMENT.wrapping_mul(n.wrapping_add(1)));
    mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}

/// Maps a number of 64 bits to a range. A remainder would favour small numbers; the high part of
/// the product does so hardly at all.
pub fn scale<N: Copy + TryFrom<u64> + TryInto<u64>>(number: u64, range: RangeInclusive<N>) -> N {
    let [least, most] = [range.start(), range.end()].map(|&it| it.try_into().unwrap_or(0));
    let choices = u128::from(most.saturating_sub(least)) + 1;
    let drawn = u64::try_from((u128::from(number) * choices) >> 64).unwrap_or(0);
    N::try_from(least + drawn).unwrap_or(*range.start())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_is_that_of_the_paper() {
        // The first numbers of SplitMix64 for the seed 0, as Java's SplittableRandom has them.
        assert_eq!(
            [nth(0, 0), nth(0, 1)],
            [0xe220_a839_7b1d_cdaf, 0x6e78_9e6a_a1b9_65f4]
        );
    }

    #[test]
    fn the_nth_number_needs_not_those_before() {
        let mut random = Random::new(7);
        let drawn: Vec<_> = (0..100).map(|_| random.number()).collect();
        assert!((0..).zip(&drawn).all(|(n, &number)| nth(7, n) == number));
    }

    #[test]
    fn draws_every_number_of_a_range() {
        let mut random = Random::new(1);
        let mut seen = [false; 5];
        for _ in 0..1000 {
            seen[random.index(5)] = true;
            assert!((3..=4).contains(&random.within(3_u8..=4)));
        }
        assert_eq!(seen, [true; 5]);
        assert_eq!(scale(u64::MAX, 0..=u64::MAX), u64::MAX);
    }
}
