//! Sorting, with a single copy of the code.
//!
//! The library's sort is compiled anew for each type and each closure, at some 6 KiB a copy, in an
//! image of 512 KiB. A commit sorts a dozen times and in no hurry. So all callers sort positions by
//! this one function, a plain merge sort of 0.6 KB.

use alloc::vec::Vec;
use core::cmp::Ordering;

/// Sorts positions by a comparison; positions that compare equal stay in their order.
pub(crate) fn sort(positions: &mut [usize], compare: &mut dyn FnMut(usize, usize) -> Ordering) {
    let mut sorted = positions.to_vec();
    // The length of the runs already in order.
    let mut length = 1;
    while length < positions.len() {
        let pairs = positions.chunks(2 * length);
        for (pair, merged) in pairs.zip(sorted.chunks_mut(2 * length)) {
            let (mut first, mut second) = pair.split_at(length.min(pair.len()));
            for place in merged {
                let is_second = match (first.first(), second.first()) {
                    (Some(&one), Some(&other)) => compare(one, other).is_gt(),
                    (first, _) => first.is_none(),
                };
                let run = if is_second { &mut second } else { &mut first };
                if let Some((&least, rest)) = run.split_first() {
                    (*place, *run) = (least, rest);
                }
            }
        }
        positions.copy_from_slice(&sorted);
        length *= 2;
    }
}

/// Sorts positions by their keys, ascending; equal keys stay in their order.
pub(crate) fn sort_by_key<K: Ord>(positions: &mut [usize], key: impl Fn(usize) -> K) {
    sort(positions, &mut |one, other| key(one).cmp(&key(other)));
}

/// Returns the positions of a list in the order of their keys, ascending; equal keys stay in their
/// order. An image has a single sort for all callers.
pub fn sorted_by_key<K: Ord>(count: usize, key: impl Fn(usize) -> K) -> Vec<usize> {
    let mut positions: Vec<usize> = (0..count).collect();
    sort_by_key(&mut positions, key);
    positions
}

/// Returns the values in ascending order.
pub(crate) fn sorted<T: Ord + Copy>(values: &[T]) -> Vec<T> {
    let order = sorted_by_key(values.len(), |position| values[position]);
    order.into_iter().map(|position| values[position]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sorts_as_the_library_does() {
        for count in 0..70usize {
            for modulus in [1, 2, 7, 64] {
                let key = |position: usize| position * 37 % 101 % modulus;
                let mut expected: Vec<usize> = (0..count).rev().collect();
                let mut found = expected.clone();
                expected.sort_by_key(|&position| key(position));
                sort_by_key(&mut found, key);
                assert_eq!(found, expected);
            }
        }
    }
}
