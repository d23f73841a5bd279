//! Numbers for names, in the order of their first appearance.
//!
//! Commits of many thousand subtasks and topics look up every name once, so the
//! table is a hash table with open addressing, sized once; a tree or a sort
//! would dominate the whole commit. The hash is FNV-1a with a final mix, enough for names that
//! an app's author chose.

use alloc::vec;
use alloc::vec::Vec;

use crate::fnv::{EMPTY, fnv_1a};

/// No entry.
const FREE: u32 = u32::MAX;

/// A table of distinct names.
pub(super) struct Interner<'a> {
    /// Positions in `names`, at the hash's place or after it.
    table: Vec<u32>,
    names: Vec<(u64, &'a str)>,
}

impl<'a> Interner<'a> {
    /// Makes a table for at most `capacity` names.
    pub(super) fn new(capacity: usize) -> Self {
        let slots = (2 * capacity).next_power_of_two().max(2);
        Self {
            table: vec![FREE; slots],
            names: Vec::with_capacity(capacity),
        }
    }

    /// Returns the name's number, counted from 0, a new one if it is new.
    pub(super) fn intern(&mut self, name: &'a str) -> usize {
        let hash = fnv_1a(EMPTY, name.as_bytes());
        let hash = hash ^ (hash >> 32);
        let mask = self.table.len() - 1;
        #[allow(
            clippy::cast_possible_truncation,
            reason = "the low bits suffice for a place in the table on every target"
        )]
        let mut place = hash as usize & mask;
        loop {
            let entry = self.table[place];
            if entry == FREE {
                let number = self.names.len();
                self.table[place] = crate::ids::to_u32(number);
                self.names.push((hash, name));
                return number;
            }
            let number = entry as usize;
            let (known_hash, known) = self.names[number];
            if known_hash == hash && known == name {
                return number;
            }
            place = (place + 1) & mask;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_follow_first_appearance() {
        let mut interner = Interner::new(4);
        let numbers: Vec<usize> = ["b", "a", "b", "", "a"]
            .into_iter()
            .map(|name| interner.intern(name))
            .collect();
        assert_eq!(numbers, [0, 1, 0, 2, 1]);
    }
}
