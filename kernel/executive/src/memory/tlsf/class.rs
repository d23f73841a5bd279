//! Block sizes, and size classes: which list a free block is in, where to search.
//!
//! The first level splits sizes at powers of two, the second splits each of
//! these ranges into 32 equal classes. Sizes below 512 bytes, whose 32 classes
//! would be narrower than a granule, share the first range with one class per
//! granule. Pure arithmetic: nothing here touches memory.

use super::block::{GRANULE, HEADER_SIZE, MIN_BLOCK_SIZE, OWNER};

/// Ranges of the first level; the last ends at [`SIZE_LIMIT`].
pub(super) const FIRST_LEVEL: usize = 32;
/// Classes of each range.
pub(super) const SECOND_LEVEL: usize = 1 << SECOND_LEVEL_LOG2;
/// Block sizes, in bytes, are below this: 1 TiB.
pub(super) const SIZE_LIMIT: usize = LINEAR_LIMIT << (FIRST_LEVEL - 1);
const _: () = assert!(SIZE_LIMIT <= 1 << OWNER);

/// The paper's recommended trade-off between waste (1/32) and list heads.
const SECOND_LEVEL_LOG2: u32 = 5;
/// Sizes below this, in bytes, have a class per granule.
const LINEAR_LIMIT: usize = GRANULE << SECOND_LEVEL_LOG2;

/// A range of block sizes, by its place on both levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Class {
    /// Below [`FIRST_LEVEL`].
    pub(super) first: usize,
    /// Below [`SECOND_LEVEL`].
    pub(super) second: usize,
}

impl Class {
    /// The class of a block of `size` bytes, which is below [`SIZE_LIMIT`].
    pub(super) const fn of(size: usize) -> Self {
        debug_assert!(size < SIZE_LIMIT);
        if size < LINEAR_LIMIT {
            return Self {
                first: 0,
                second: size / GRANULE,
            };
        }
        let log2 = size.ilog2();
        Self {
            first: (log2 - LINEAR_LIMIT.ilog2() + 1) as usize,
            second: (size >> (log2 - SECOND_LEVEL_LOG2)) % SECOND_LEVEL,
        }
    }

    /// The smallest class whose every block has at least `size` bytes, a multiple
    /// of the granule; `None` if there is none.
    pub(super) const fn fitting(size: usize) -> Option<Self> {
        if size < LINEAR_LIMIT {
            return Some(Self::of(size));
        }
        if size >= SIZE_LIMIT {
            return None;
        }
        // Any size that is not the least of its class goes to the class above.
        let width = 1 << (size.ilog2() - SECOND_LEVEL_LOG2);
        let rounded = size + (width - 1);
        if rounded >= SIZE_LIMIT {
            return None;
        }
        Some(Self::of(rounded))
    }
}

/// The size of the smallest block with a payload of `payload_size` bytes, or
/// `None` when no block can be that large.
pub(super) fn block_size_for(payload_size: usize) -> Option<usize> {
    let size = payload_size
        .checked_add(HEADER_SIZE)?
        .checked_next_multiple_of(GRANULE)?
        .max(MIN_BLOCK_SIZE);
    (size < SIZE_LIMIT).then_some(size)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Multiples of the granule around every class boundary below 1 MiB, and
    /// around the powers of two above.
    fn interesting_sizes() -> impl Iterator<Item = usize> {
        let small = (GRANULE..1 << 20).step_by(GRANULE);
        let large = (20..40).flat_map(|log2| {
            let power = 1_usize << log2;
            [power - GRANULE, power, power + GRANULE, power + power / 2]
        });
        small.chain(large)
    }

    fn rank(class: Class) -> usize {
        class.first * SECOND_LEVEL + class.second
    }

    #[test]
    fn larger_sizes_never_have_smaller_classes() {
        let ranks: Vec<usize> = interesting_sizes()
            .map(|size| rank(Class::of(size)))
            .collect();
        assert!(ranks.is_sorted());
        assert!(ranks.iter().all(|&rank| rank < FIRST_LEVEL * SECOND_LEVEL));
    }

    #[test]
    fn fitting_is_the_first_class_above_all_smaller_sizes() {
        for size in interesting_sizes() {
            let Some(fitting) = Class::fitting(size) else {
                assert!(size > SIZE_LIMIT - SIZE_LIMIT / 32, "{size}");
                continue;
            };
            let smaller = Class::of(size - GRANULE);
            assert!(rank(fitting) > rank(smaller), "{size} could find less");
            assert!(rank(fitting) <= rank(smaller) + 1 + usize::from(fitting.first > 0));
            assert!(rank(fitting) <= rank(Class::of(size)) + 1, "{size}");
        }
    }

    #[test]
    fn sizes_from_the_limit_on_have_no_fitting_class() {
        let last_class = SIZE_LIMIT - SIZE_LIMIT / 64;
        assert_eq!(rank(Class::of(last_class)), FIRST_LEVEL * SECOND_LEVEL - 1);
        assert_eq!(Class::fitting(last_class), Some(Class::of(last_class)));
        assert_eq!(Class::fitting(last_class + GRANULE), None);
        assert_eq!(Class::fitting(SIZE_LIMIT), None);
        assert_eq!(Class::fitting(usize::MAX), None);
    }
}
