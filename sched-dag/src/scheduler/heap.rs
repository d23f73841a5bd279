//! A heap of numbered items by key, with a table of each item's position.
//!
//! The items are `0..capacity`, each in the heap at most once, so an item can be found and removed,
//! or get another key, in logarithmic time (Williams, Communications of the ACM 7, 1964, with a
//! table of positions next to the heap). Each entry has four below it, which makes paths half as
//! long as with two, and a moving entry is written once, at its final place (LaMarca and Ladner,
//! Journal of Experimental Algorithmics 1, 1996). All memory is allocated when the heap is made.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

/// The number of entries below each entry.
const BELOW: usize = 4;

/// The position of an item that is not in the heap.
const ABSENT: usize = usize::MAX;

/// A heap with the smallest key on top.
#[derive(Debug, Hash)]
pub(super) struct IndexedHeap<K> {
    entries: Vec<(K, usize)>,
    /// By item, its position in `entries`.
    positions: Box<[usize]>,
}

impl<K: Copy> Clone for IndexedHeap<K> {
    /// Allocates the same room: a cloned `Vec` has capacity only for its elements.
    fn clone(&self) -> Self {
        let mut entries = Vec::with_capacity(self.positions.len());
        entries.extend_from_slice(&self.entries);
        Self {
            entries,
            positions: self.positions.clone(),
        }
    }
}

impl<K: Ord + Copy> IndexedHeap<K> {
    /// Makes an empty heap for the items `0..capacity`.
    #[inline]
    pub(super) fn new(capacity: usize) -> Self {
        Self {
            entries: Vec::with_capacity(capacity),
            positions: vec![ABSENT; capacity].into_boxed_slice(),
        }
    }

    /// Returns the smallest key and its item.
    #[inline]
    pub(super) fn peek(&self) -> Option<(K, usize)> {
        self.entries.first().copied()
    }

    /// Returns the key of an item, if the item is in the heap.
    pub(super) fn key_of(&self, item: usize) -> Option<K> {
        self.entries.get(self.positions[item]).map(|(key, _)| *key)
    }

    /// Puts an item into the heap, or gives it another key.
    #[inline(always)]
    pub(super) fn set(&mut self, item: usize, key: K) {
        let position = self.positions[item];
        let entry = (key, item);
        match self.entries.get(position) {
            // `ABSENT` is no position, so an item outside the heap ends up here.
            None => {
                self.entries.push(entry);
                self.rise(self.entries.len() - 1, entry);
            }
            Some((old, _)) if *old < key => self.sink_if_above(position, entry),
            Some(_) => self.rise(position, entry),
        }
    }

    /// Takes the item with the smallest key out.
    #[inline]
    pub(super) fn pop(&mut self) -> Option<(K, usize)> {
        let (key, item) = self.peek()?;
        self.remove(item);
        Some((key, item))
    }

    /// Takes an item out, if it is in the heap.
    #[inline]
    pub(super) fn remove(&mut self, item: usize) {
        let position = self.positions[item];
        if position == ABSENT {
            return;
        }
        // Before the last entry moves: the two may be the same.
        self.positions[item] = ABSENT;
        let Some(last) = self.entries.pop() else {
            return;
        };
        // The last entry fills the gap, and may belong above or below. If the last entry was the
        // gap itself, nothing is left to do.
        if let Some((removed, _)) = self.entries.get(position) {
            match *removed < last.0 {
                true => self.sink(position, last),
                false => self.rise(position, last),
            }
        }
    }

    /// Puts an entry at `position`, or above.
    #[inline]
    fn rise(&mut self, mut position: usize, entry: (K, usize)) {
        while position > 0 {
            let above = (position - 1) / BELOW;
            // Of equal keys the upper entry stays: an exchange would only cost writes.
            if self.entries[above].0 <= entry.0 {
                break;
            }
            self.put(position, self.entries[above]);
            position = above;
        }
        self.put(position, entry);
    }

    /// Puts an entry at `position`, or below; at once if nothing is below.
    #[inline]
    fn sink_if_above(&mut self, position: usize, entry: (K, usize)) {
        // A leaf with a larger key stays a leaf.
        if BELOW * position + 1 < self.entries.len() {
            self.sink(position, entry);
        } else {
            self.entries[position] = entry;
        }
    }

    /// Puts an entry at `position`, or below.
    #[inline]
    fn sink(&mut self, mut position: usize, entry: (K, usize)) {
        while let first = BELOW * position + 1
            && let Some(below) = self.entries.get(first..)
            && let Some((from, least)) = least(below)
            && least.0 < entry.0
        {
            self.put(position, least);
            position = first + from;
        }
        self.put(position, entry);
    }

    #[inline]
    fn put(&mut self, position: usize, entry: (K, usize)) {
        self.entries[position] = entry;
        self.positions[entry.1] = position;
    }
}

/// Returns the smallest of the first [`BELOW`] entries, the first of equal entries, and its place.
#[inline]
fn least<K: Ord + Copy>(entries: &[(K, usize)]) -> Option<(usize, (K, usize))> {
    if let Some((four, _)) = entries.split_first_chunk::<BELOW>() {
        // The smallest is unpredictable: places are calculated, without a conditional jump.
        let one = usize::from(four[1].0 < four[0].0);
        let other = 2 + usize::from(four[3].0 < four[2].0);
        let place = match four[other].0 < four[one].0 {
            true => other,
            false => one,
        };
        return Some((place, four[place]));
    }
    // Fewer than four: the last group of the heap.
    let mut least = (0, *entries.first()?);
    for (place, &entry) in entries.iter().enumerate().skip(1) {
        if entry.0 < least.1.0 {
            least = (place, entry);
        }
    }
    Some(least)
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
        // Removed twice, as nothing forbids it.
        for item in (0..100).step_by(3).flat_map(|item| [item, item]) {
            heap.remove(item);
        }
        for item in (1..100).step_by(3) {
            heap.set(item, 200 - item);
        }
        let changed = (1..100).step_by(3).map(|item| (200 - item, item));
        let kept = (2..100).step_by(3).map(|item| ((item * 37) % 100, item));
        let mut expected: Vec<_> = changed.chain(kept).collect();
        expected.sort_unstable();
        assert!(core::iter::from_fn(|| heap.pop()).eq(expected));
    }
}
