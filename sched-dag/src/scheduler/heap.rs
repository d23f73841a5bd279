//! A binary heap of items that are known by index.
//!
//! The items are `0..capacity`, each in the heap at most once, so that an item
//! can be found and removed, or get another key, in logarithmic time (Williams,
//! Communications of the ACM 7, 1964, with a table of positions next to it). All
//! memory is taken when the heap is made.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use crate::ids::to_u32;

/// The position of an item that is not in the heap.
const ABSENT: u32 = u32::MAX;

/// A heap with the smallest key on top.
#[derive(Clone, Debug, Hash)]
pub(crate) struct IndexedHeap<K> {
    entries: Vec<(K, u32)>,
    /// Where in `entries` each item is.
    positions: Box<[u32]>,
}

impl<K: Ord + Copy> IndexedHeap<K> {
    /// Makes an empty heap for the items `0..capacity`.
    #[inline]
    pub(crate) fn new(capacity: usize) -> Self {
        Self {
            entries: Vec::with_capacity(capacity),
            positions: vec![ABSENT; capacity].into_boxed_slice(),
        }
    }

    /// Returns the smallest key and its item.
    #[inline]
    pub(crate) fn peek(&self) -> Option<(K, usize)> {
        self.entries
            .first()
            .map(|&(key, item)| (key, item as usize))
    }

    /// Returns an item's key, if it is in.
    #[inline]
    pub(crate) fn key(&self, item: usize) -> Option<K> {
        self.entries
            .get(self.positions[item] as usize)
            .map(|&(key, _)| key)
    }

    /// Puts an item into the heap, or gives it another key.
    #[inline]
    pub(crate) fn set(&mut self, item: usize, key: K) {
        let position = self.positions[item];
        if position == ABSENT {
            self.entries.push((key, to_u32(item)));
            self.positions[item] = to_u32(self.entries.len() - 1);
            self.rise(self.entries.len() - 1);
        } else {
            self.entries[position as usize].0 = key;
            self.sink(position as usize);
            self.rise(self.positions[item] as usize);
        }
    }

    /// Takes the item with the smallest key out.
    #[inline]
    pub(crate) fn pop(&mut self) -> Option<(K, usize)> {
        let (key, item) = self.peek()?;
        self.remove(item);
        Some((key, item))
    }

    /// Takes an item out, if it is in.
    #[inline]
    pub(crate) fn remove(&mut self, item: usize) {
        let position = self.positions[item];
        if position == ABSENT {
            return;
        }
        let position = position as usize;
        self.positions[item] = ABSENT;
        self.entries.swap_remove(position);
        if position < self.entries.len() {
            let moved = self.entries[position].1;
            self.positions[moved as usize] = to_u32(position);
            self.sink(position);
            self.rise(self.positions[moved as usize] as usize);
        }
    }

    #[inline]
    fn rise(&mut self, mut position: usize) {
        while position > 0 {
            let above = (position - 1) / 2;
            if self.entries[above].0 <= self.entries[position].0 {
                return;
            }
            self.swap(above, position);
            position = above;
        }
    }

    #[inline]
    fn sink(&mut self, mut position: usize) {
        loop {
            let left = 2 * position + 1;
            if left >= self.entries.len() {
                return;
            }
            let right = left + 1;
            let right_is_smaller =
                right < self.entries.len() && self.entries[right].0 < self.entries[left].0;
            let below = if right_is_smaller { right } else { left };
            if self.entries[position].0 <= self.entries[below].0 {
                return;
            }
            self.swap(position, below);
            position = below;
        }
    }

    #[inline]
    fn swap(&mut self, one: usize, other: usize) {
        self.entries.swap(one, other);
        self.positions[self.entries[one].1 as usize] = to_u32(one);
        self.positions[self.entries[other].1 as usize] = to_u32(other);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pops_ascending_after_sets_changes_and_removals() {
        let mut heap = IndexedHeap::new(100);
        for item in 0..100 {
            heap.set(item, (item * 37) % 100);
        }
        for item in (0..100).step_by(3) {
            heap.remove(item);
            heap.remove(item);
        }
        for item in (1..100).step_by(3) {
            heap.set(item, 200 - item);
        }
        let mut popped = Vec::new();
        while let Some((key, item)) = heap.pop() {
            let expected = if item % 3 == 1 {
                200 - item
            } else {
                (item * 37) % 100
            };
            assert_eq!(key, expected);
            popped.push(key);
        }
        assert_eq!(popped.len(), 66);
        assert!(popped.is_sorted());
    }
}
