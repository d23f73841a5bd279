//! The free blocks by class, and the bitmaps that find a fitting one at once.
//!
//! Lists are doubly linked through the payloads of their blocks, so that a block
//! leaves its list without a search. Insertion is at the front: memory that was
//! freed last, and is likely still cached, goes out first. This file alone marks
//! blocks as free or used, which is how the invariant **Listing** of the
//! [module above](super) is kept.

use super::block::{Block, Links};
use super::class::{Class, FIRST_LEVEL, SECOND_LEVEL};

/// The list of each class.
///
/// Bit `f` of `ranges` is set exactly when `classes[f]` is not zero; bit `s` of
/// `classes[f]` exactly when `heads[f][s]` is a block.
#[derive(Debug)]
pub(super) struct FreeLists {
    ranges: u32,
    classes: [u32; FIRST_LEVEL],
    heads: [[Option<Block>; SECOND_LEVEL]; FIRST_LEVEL],
}

const _: () = assert!(FIRST_LEVEL == 32 && SECOND_LEVEL == 32, "the bits of a u32");

impl FreeLists {
    pub(super) const fn new() -> Self {
        Self {
            ranges: 0,
            classes: [0; FIRST_LEVEL],
            heads: [[None; SECOND_LEVEL]; FIRST_LEVEL],
        }
    }

    /// Takes a block of at least `size` bytes out of its list.
    pub(super) fn take(&mut self, size: usize) -> Option<Block> {
        let class = self.first_nonempty_from(Class::fitting(size)?)?;
        let block = self.head(class)?;
        self.remove(block);
        Some(block)
    }

    /// Lists a used block, which makes it free.
    pub(super) fn insert(&mut self, block: Block) {
        debug_assert!(!block.is_free(), "a listed block cannot be listed again");
        let class = Class::of(block.size());
        let after = self.head(class);
        block.set_links(Links {
            before: None,
            after,
        });
        if let Some(after) = after {
            after.set_links(Links {
                before: Some(block),
                ..after.links()
            });
        }
        block.set_free(true);
        self.set_head(class, Some(block));
    }

    /// Takes a free block out of its list, which makes it used.
    pub(super) fn remove(&mut self, block: Block) {
        let Links { before, after } = block.links();
        if let Some(after) = after {
            after.set_links(Links {
                before,
                ..after.links()
            });
        }
        match before {
            Some(before) => before.set_links(Links {
                after,
                ..before.links()
            }),
            None => self.set_head(Class::of(block.size()), after),
        }
        block.set_free(false);
    }

    /// The first block in the list of a class.
    pub(super) const fn head(&self, class: Class) -> Option<Block> {
        self.heads[class.first][class.second]
    }

    /// Whether the bitmaps say that a class has blocks.
    #[cfg(test)]
    pub(super) const fn is_marked(&self, class: Class) -> bool {
        let range = self.ranges >> class.first & 1 == 1;
        let list = self.classes[class.first] >> class.second & 1 == 1;
        debug_assert!(range == (self.classes[class.first] != 0));
        list
    }

    /// The smallest class from `class` on that has a block: one bit scan in its
    /// own range or, if there is none, one each on both levels.
    fn first_nonempty_from(&self, class: Class) -> Option<Class> {
        let same_range = self.classes[class.first] & (u32::MAX << class.second);
        if same_range != 0 {
            return Some(Class {
                second: same_range.trailing_zeros() as usize,
                ..class
            });
        }
        // Two shifts: for the last range one by 32 bits would overflow.
        let larger_ranges = self.ranges & (u32::MAX << class.first << 1);
        if larger_ranges == 0 {
            return None;
        }
        let first = larger_ranges.trailing_zeros() as usize;
        let second = self.classes[first].trailing_zeros() as usize;
        Some(Class { first, second })
    }

    fn set_head(&mut self, class: Class, head: Option<Block>) {
        self.heads[class.first][class.second] = head;
        let list_bit = 1 << class.second;
        if head.is_some() {
            self.classes[class.first] |= list_bit;
        } else {
            self.classes[class.first] &= !list_bit;
        }
        let range_bit = 1 << class.first;
        if self.classes[class.first] != 0 {
            self.ranges |= range_bit;
        } else {
            self.ranges &= !range_bit;
        }
    }
}
