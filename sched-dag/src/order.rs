//! Sorting, once for all.
//!
//! Each type and each closure that the library's sort is called with makes another
//! copy of it, of some 6 KiB, in an image that has 512. A commit sorts a dozen
//! times and in no hurry; so all of them sort positions by this one function.

use alloc::vec::Vec;
use core::cmp::Ordering;

/// Sorts positions by a comparison; equal ones stay in their order.
pub(crate) fn sort(positions: &mut [usize], compare: &mut dyn FnMut(usize, usize) -> Ordering) {
    positions.sort_by(|&one, &other| compare(one, other));
}

/// Sorts positions by their keys, ascending; equal ones stay in their order.
pub(crate) fn sort_by_key<K: Ord>(positions: &mut [usize], key: impl Fn(usize) -> K) {
    sort(positions, &mut |one, other| key(one).cmp(&key(other)));
}

/// Returns the positions of a list in the order of their keys, ascending; equal
/// ones stay in their order.
pub(crate) fn sorted_by_key<K: Ord>(count: usize, key: impl Fn(usize) -> K) -> Vec<usize> {
    let mut positions: Vec<usize> = (0..count).collect();
    sort_by_key(&mut positions, key);
    positions
}

/// Returns the values in ascending order.
pub(crate) fn sorted<T: Ord + Copy>(values: &[T]) -> Vec<T> {
    let order = sorted_by_key(values.len(), |position| values[position]);
    order.into_iter().map(|position| values[position]).collect()
}
