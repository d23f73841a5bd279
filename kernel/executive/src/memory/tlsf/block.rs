//! Blocks in raw memory: the only place for reading and writing them.
//!
//! A [`Block`] is a pointer to a header. Its methods are safe to call because only
//! [`Block::create_region`] and [`Block::of_payload`] make a block from nothing, and both are
//! `unsafe`; the rest follows from the invariants **Ownership**, **Tiling** and **Listing** of the
//! [module above](super); each method here keeps and relies on them.
//!
//! ```text
//!  |<-------------- size (multiple of 16) ------------->|
//!  | size, free bit, owner | previous | links, while free  ... | header of the next
//!  ^ block, 16-aligned         ^ payload, 16-aligned
//! ```
//!
//! Pointers stay pointers, never integers: each is derived from the pointer given when its region
//! was added, as strict provenance asks for.
//!
//! # Size classes: in which list a free block is, and where to search
//!
//! The first level splits sizes at powers of two, the second splits each of these ranges into 32
//! equal classes. Sizes below 512 bytes, whose 32 classes would be narrower than a granule, share
//! the first range with one class per granule. Pure arithmetic: nothing here touches memory.

use core::ptr::NonNull;

/// The unit of all block addresses and sizes in bytes, and the alignment of every payload.
pub(super) const GRANULE: usize = 16;
/// The bytes before the payload of a block.
pub(super) const HEADER_SIZE: usize = size_of::<Header>();
/// The bytes of the smallest block: its payload holds the links when free.
pub(super) const MIN_BLOCK_SIZE: usize = HEADER_SIZE + size_of::<FreeLinks>();

const _: () = assert!(HEADER_SIZE == GRANULE && align_of::<Header>() == GRANULE);
const _: () = assert!(MIN_BLOCK_SIZE == 2 * GRANULE && align_of::<FreeLinks>() <= GRANULE);

/// The bit of [`Header::size_and_free`] for a free block.
const FREE: usize = 1;
/// The first bit of a used block's owner, above any size.
const OWNER: u32 = 40;

/// A block of the tiling, or an end marker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Block(NonNull<Header>);

#[derive(Clone, Copy)]
#[repr(C, align(16))]
struct Header {
    /// The size; its lowest bits, zero in a multiple of 16, hold [`FREE`], its highest the owner.
    size_and_free: usize,
    /// The block that ends at this block's start; `None` for a region's first.
    previous: Option<Block>,
}

/// The neighbours of a free block in the list of its class.
#[derive(Clone, Copy)]
pub(super) struct FreeLinks {
    pub(super) before: Option<Block>,
    pub(super) after: Option<Block>,
}

impl Block {
    /// Makes a region of one used block of `size` bytes and an end marker.
    ///
    /// # Safety
    ///
    /// 1. `start` is 16-aligned; `size` is a multiple of 16, at least [`MIN_BLOCK_SIZE`].
    /// 2. **Ownership** holds for `size + HEADER_SIZE` bytes from `start` on.
    pub(super) unsafe fn create_region(start: NonNull<u8>, size: usize) -> Self {
        let block = Self(start.cast());
        // The end marker has size 0, and is used so that nothing merges with it.
        let end = block.at_offset(size);
        end.write(Header {
            size_and_free: 0,
            previous: Some(block),
        });
        block.write(Header {
            size_and_free: size,
            previous: None,
        });
        block
    }

    /// Returns the block with a given payload.
    ///
    /// # Safety
    ///
    /// [`payload`](Self::payload) returned `payload` for a block still in the tiling.
    pub(super) const unsafe fn of_payload(payload: NonNull<u8>) -> Self {
        // SAFETY: by the caller's promise and Tiling a header lies before it, in
        // the same region.
        Self(unsafe { payload.byte_sub(HEADER_SIZE) }.cast())
    }

    /// Returns the memory after the header.
    pub(super) fn payload(self) -> NonNull<u8> {
        self.at_offset(HEADER_SIZE).0.cast()
    }

    /// Returns the size in bytes, header included; 0 for an end marker.
    pub(super) fn size(self) -> usize {
        self.read().size_and_free & ((1 << OWNER) - 1) & !FREE
    }

    /// Returns the owner of a used block, 0 if there is none.
    pub(super) fn owner(self) -> u32 {
        u32::try_from(self.read().size_and_free >> OWNER).unwrap_or(0)
    }

    /// Gives a used block an owner, of 24 bits.
    pub(super) fn set_owner(self, owner: u32) {
        let owner = owner as usize & (usize::MAX >> OWNER);
        self.write(Header {
            size_and_free: self.size() | owner << OWNER,
            ..self.read()
        });
    }

    pub(super) fn is_free(self) -> bool {
        self.read().size_and_free & FREE != 0
    }

    /// Returns the block before this block, or `None` for a region's first.
    pub(super) fn previous(self) -> Option<Self> {
        self.read().previous
    }

    /// Returns the block, or the end marker, after this block.
    pub(super) fn next(self) -> Self {
        debug_assert!(self.size() != 0, "nothing follows an end marker");
        self.at_offset(self.size())
    }

    /// Marks the block as free, or as used, by nobody. Only the free lists may: **Listing**.
    pub(super) fn set_free(self, free: bool) {
        let flag = if free { FREE } else { 0 };
        self.write(Header {
            size_and_free: self.size() | flag,
            ..self.read()
        });
    }

    /// Cuts a used block after `size` bytes and returns the part behind the cut, used as well. Both
    /// parts must be at least as large as the smallest block.
    pub(super) fn split(self, size: usize) -> Self {
        let whole = self.read();
        debug_assert!(size >= MIN_BLOCK_SIZE && size.is_multiple_of(GRANULE));
        debug_assert!(self.size() - size >= MIN_BLOCK_SIZE);
        let after = self.next();
        let rest = self.at_offset(size);
        rest.write(Header {
            size_and_free: self.size() - size,
            previous: Some(self),
        });
        self.write(Header {
            // A difference, not a new size: the owner in the upper bits stays.
            size_and_free: whole.size_and_free - (self.size() - size),
            ..whole
        });
        after.set_previous(rest);
        rest
    }

    /// Merges the used block `next`, the successor of this used block, into this block.
    pub(super) fn absorb(self, next: Self) {
        debug_assert!(self.next() == next && !self.is_free() && !next.is_free());
        let header = self.read();
        let after = next.next();
        self.write(Header {
            // A sum, likewise.
            size_and_free: header.size_and_free + next.size(),
            ..header
        });
        after.set_previous(self);
    }

    /// Returns the links of a listed block.
    pub(super) fn links(self) -> FreeLinks {
        debug_assert!(self.is_free(), "a used block has no links");
        let links: NonNull<FreeLinks> = self.payload().cast();
        // SAFETY: by Listing they are initialised, by Ownership ours to read.
        unsafe { links.read() }
    }

    /// Sets the links of a block already listed, or about to be.
    pub(super) fn set_links(self, links: FreeLinks) {
        let place: NonNull<FreeLinks> = self.payload().cast();
        // SAFETY: no caller holds this block, so that by Ownership its payload is
        // ours; by Tiling it has the room, and the alignment of a granule.
        unsafe { place.write(links) };
    }

    fn set_previous(self, previous: Self) {
        self.write(Header {
            previous: Some(previous),
            ..self.read()
        });
    }

    /// Returns the place `offset` bytes after the start of this block, at most its size.
    fn at_offset(self, offset: usize) -> Self {
        // SAFETY: by Tiling a block and the header after it are in one region.
        Self(unsafe { self.0.byte_add(offset) })
    }

    fn read(self) -> Header {
        // SAFETY: by Tiling the header is initialised, by Ownership ours to read.
        unsafe { self.0.read() }
    }

    fn write(self, header: Header) {
        // SAFETY: by Tiling and Ownership headers are ours to write, also where a
        // split is about to put one: within a block that no caller holds.
        unsafe { self.0.write(header) };
    }
}

/// The number of ranges of the first level; the last ends at [`SIZE_LIMIT`].
pub(super) const FIRST_LEVEL: usize = 32;
/// The number of classes in each range.
pub(super) const SECOND_LEVEL: usize = 1 << SECOND_LEVEL_LOG2;
/// The exclusive limit of block sizes in bytes: 1 TiB.
pub(super) const SIZE_LIMIT: usize = LINEAR_LIMIT << (FIRST_LEVEL - 1);
const _: () = assert!(SIZE_LIMIT <= 1 << OWNER);

/// The binary logarithm of the classes in a range: the paper's recommended trade-off between waste
/// (1/32) and list heads.
const SECOND_LEVEL_LOG2: u32 = 5;
/// The limit of the sizes, in bytes, with a class per granule.
const LINEAR_LIMIT: usize = GRANULE << SECOND_LEVEL_LOG2;

/// A range of block sizes, by its place on both levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SizeClass {
    /// Below [`FIRST_LEVEL`].
    pub(super) first: usize,
    /// Below [`SECOND_LEVEL`].
    pub(super) second: usize,
}

impl SizeClass {
    /// Returns the class of a block of `size` bytes, below [`SIZE_LIMIT`].
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

    /// Returns the smallest class whose every block has at least `size` bytes, a multiple of the
    /// granule; `None` if there is no such class.
    pub(super) const fn fitting(size: usize) -> Option<Self> {
        if size < LINEAR_LIMIT {
            return Some(Self::of(size));
        }
        if size >= SIZE_LIMIT {
            return None;
        }
        // Any size other than the least of its class goes to the class above.
        let width = 1 << (size.ilog2() - SECOND_LEVEL_LOG2);
        let rounded = size + (width - 1);
        if rounded >= SIZE_LIMIT {
            return None;
        }
        Some(Self::of(rounded))
    }
}

/// Returns the size of the smallest block with a payload of `payload_size` bytes, or `None` if no
/// block can be that large.
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

    fn rank(class: SizeClass) -> usize {
        class.first * SECOND_LEVEL + class.second
    }

    #[test]
    fn larger_sizes_never_have_smaller_classes() {
        let ranks: Vec<usize> = interesting_sizes()
            .map(|size| rank(SizeClass::of(size)))
            .collect();
        assert!(ranks.is_sorted());
        assert!(ranks.iter().all(|&rank| rank < FIRST_LEVEL * SECOND_LEVEL));
    }

    #[test]
    fn fitting_is_the_first_class_above_all_smaller_sizes() {
        for size in interesting_sizes() {
            let Some(fitting) = SizeClass::fitting(size) else {
                assert!(size > SIZE_LIMIT - SIZE_LIMIT / 32, "{size}");
                continue;
            };
            let smaller = SizeClass::of(size - GRANULE);
            assert!(rank(fitting) > rank(smaller), "{size} could find less");
            assert!(rank(fitting) <= rank(smaller) + 1 + usize::from(fitting.first > 0));
            assert!(rank(fitting) <= rank(SizeClass::of(size)) + 1, "{size}");
        }
    }

    #[test]
    fn sizes_from_the_limit_on_have_no_fitting_class() {
        let last_class = SIZE_LIMIT - SIZE_LIMIT / 64;
        assert_eq!(
            rank(SizeClass::of(last_class)),
            FIRST_LEVEL * SECOND_LEVEL - 1
        );
        assert_eq!(
            SizeClass::fitting(last_class),
            Some(SizeClass::of(last_class))
        );
        assert_eq!(SizeClass::fitting(last_class + GRANULE), None);
        assert_eq!(SizeClass::fitting(SIZE_LIMIT), None);
        assert_eq!(SizeClass::fitting(usize::MAX), None);
    }
}
