//! A heap with bounded time for every operation: two-level segregated fit.
//!
//! The algorithm is by M. Masmano, I. Ripoll, A. Crespo and J. Real, "TLSF: a new dynamic memory
//! allocator for real-time systems", ECRTS 2004, doi
//! [10.1109/EMRTS.2004.1311009](https://doi.org/10.1109/EMRTS.2004.1311009).
//!
//! # Words
//!
//! - A *region* is a piece of memory given to the allocator for good.
//! - A *block* is a part of a region: a 16-byte header, then its *payload*, held by a caller while
//!   the block is *used*. Block sizes count the header and are multiples of the *granule*, 16
//!   bytes.
//! - A *class* is a range of block sizes. Each class has a list of its *free* blocks; two levels of
//!   bitmaps mark the nonempty lists.
//! - The *end marker* is a header with no payload at the end of a region.
//!
//! # Invariants
//!
//! The safety comments of this module cite these by name.
//!
//! - **Ownership**: from [`Tlsf::add_region`] on, the allocator alone reads and writes a region,
//!   through pointers derived from the region's own, except for the payloads of used blocks, which
//!   belong to their callers.
//! - **Tiling**: blocks fill a region without gaps, up to its end marker. A block's header is
//!   initialised; its size leads to the next header, and the next header's `previous` leads back. A
//!   `Block` value names a block of the tiling; after a merge the absorbed block's value is not
//!   used.
//! - **Listing**: a block is marked free exactly while listed in its class; its links are then
//!   initialised and name blocks of that list.
//!
//! # Guarantees
//!
//! - Allocating, deallocating and resizing run without loops: they take a few bit scans and a
//!   constant number of block splits and merges, whatever the history and the number of blocks.
//! - Two free blocks are never neighbours: freed memory merges at once.
//! - Fit is good, not best: the block comes from the first nonempty class whose *every* block is
//!   large enough. A request can hence fail although a free block less than 1/32 larger than the
//!   request is left over.
//!
//! # Not guaranteed
//!
//! - The allocator does not lock: `&mut self` is the caller's proof of exclusion.
//! - The allocator does not clear memory, neither when handing memory out nor on return.
//! - The allocator does not join neighbouring regions, nor give a region back.
//! - The allocator does not detect wrong use in release builds; debug builds catch a second free
//!   and a wrong size if the header still tells.
//!
//! # The free blocks by class, and the bitmaps for finding a fitting block at once
//!
//! Lists are doubly linked through the payloads of their blocks, so a block leaves its list without
//! a search. Insertion is at the front: the memory freed last, and likely still cached, goes out
//! first. This file alone marks blocks as free or used, and so keeps the invariant **Listing** of
//! the [module above](super).

mod block;
#[cfg(test)]
mod tests;

use core::alloc::Layout;
use core::ptr::NonNull;

use front::report::HeapUsage;

use block::{
    Block, FIRST_LEVEL, FreeLinks, GRANULE, HEADER_SIZE, MIN_BLOCK_SIZE, SECOND_LEVEL, SIZE_LIMIT,
    SizeClass, block_size_for,
};

/// An allocator over any number of memory regions.
pub(crate) struct Tlsf {
    free: FreeLists,
    usage: HeapUsage,
    /// The first block of the region added last.
    first: Option<Block>,
}

// SAFETY: by Ownership no one else reaches the memory behind the pointers of the
// lists, and nothing in it belongs to a core: it may move with the allocator.
unsafe impl Send for Tlsf {}

impl Tlsf {
    /// Creates an allocator without memory: every allocation fails until
    /// [`add_region`](Self::add_region).
    pub(crate) const fn new() -> Self {
        Self {
            free: FreeLists::new(),
            usage: HeapUsage {
                allocations: 0,
                in_use_bytes: 0,
                peak_bytes: 0,
                capacity_bytes: 0,
            },
            first: None,
        }
    }

    /// Adds the `length` bytes from `start` on to the heap.
    ///
    /// Both ends are aligned inwards to 16 bytes. A region then shorter than 48 bytes is ignored,
    /// and any excess over 1 TiB is left alone; the growth of [`HeapUsage::capacity_bytes`] tells
    /// how much was taken.
    ///
    /// # Safety
    ///
    /// 1. The region is valid for reads and writes through `start`, all of it, as long as the
    ///    allocator or any of its allocations is in use.
    /// 2. Nothing else uses the region from now on.
    pub(crate) unsafe fn add_region(&mut self, start: NonNull<u8>, length: usize) {
        let skipped = start.addr().get().wrapping_neg() % GRANULE;
        let aligned_length = length.saturating_sub(skipped) / GRANULE * GRANULE;
        let size = aligned_length
            .saturating_sub(HEADER_SIZE)
            .min(SIZE_LIMIT - GRANULE);
        if size < MIN_BLOCK_SIZE {
            return;
        }
        // SAFETY: `skipped < length`, so this stays within the region (1).
        let first = unsafe { start.byte_add(skipped) };
        // SAFETY: `first` is aligned, and the block with its end marker is within
        // the region; with (1) and (2) this establishes Ownership.
        let block = unsafe { Block::create_region(first, size) };
        self.usage.capacity_bytes += size;
        self.first = Some(block);
        self.free.insert(block);
    }

    /// Notes the owner of an allocation, by a number of 24 bits; 0 is nobody.
    ///
    /// # Safety
    ///
    /// `payload` came from [`allocate`](Self::allocate) of this allocator, and was not deallocated
    /// since.
    pub(crate) unsafe fn set_owner(&mut self, payload: NonNull<u8>, owner: u32) {
        // SAFETY: by the caller's promise it is the payload of a used block of the tiling.
        unsafe { Block::of_payload(payload) }.set_owner(owner);
    }

    /// Passes `take` the owner and the size of each block in use with an owner, and makes the block
    /// nobody's: in the region added last. Takes a step for each block, used or free.
    pub(crate) fn take_owned(&mut self, mut take: impl FnMut(u32, usize)) {
        let mut next = self.first;
        while let Some(block) = next.filter(|block| block.size() > 0) {
            if !block.is_free() && block.owner() > 0 {
                take(block.owner(), block.size());
                block.set_owner(0);
            }
            next = Some(block.next());
        }
    }

    /// Returns memory for `layout`, or `None` if no class sure to fit has a free block.
    ///
    /// Every alignment is served. An alignment above 16 bytes needs, while searching, a block
    /// larger by the alignment and 16 bytes; the unused part returns to the heap at once. A size of
    /// zero takes a smallest block.
    pub(crate) fn allocate(&mut self, layout: Layout) -> Option<NonNull<u8>> {
        let needed = block_size_for(layout.size())?;
        let slack = if layout.align() > GRANULE {
            layout.align() + GRANULE
        } else {
            0
        };
        let found = self.free.take_free(needed.checked_add(slack)?)?;
        let block = self.trim_front(found, layout.align());
        self.trim_back(block, needed);
        self.usage.allocations += 1;
        self.count_resize(0, block.size());
        Some(block.payload())
    }

    /// Takes memory back, and merges the block with its free neighbours.
    ///
    /// # Safety
    ///
    /// 1. `payload` came from [`allocate`](Self::allocate) of this allocator, and was not
    ///    deallocated since.
    /// 2. `layout` is the layout of the allocation, with the size of the last successful
    ///    [`reallocate_in_place`](Self::reallocate_in_place).
    /// 3. Nothing uses the memory any more.
    pub(crate) unsafe fn deallocate(&mut self, payload: NonNull<u8>, layout: Layout) {
        // SAFETY: by (1) it is the payload of a used block of the tiling.
        let block = unsafe { Block::of_payload(payload) };
        debug_assert!(!block.is_free(), "{payload:p} is deallocated twice");
        debug_assert!(
            layout.size() <= block.size() - HEADER_SIZE,
            "{payload:p} is deallocated with a larger size than it was allocated with"
        );
        self.usage.in_use_bytes -= block.size();
        self.release(block);
    }

    /// Resizes an allocation in place, and tells whether this was possible.
    ///
    /// Shrinking always is; growing is possible if the memory after the block is free and suffices.
    /// Contents up to the smaller size are kept. Counts neither as an allocation nor as a
    /// deallocation.
    ///
    /// # Safety
    ///
    /// 1. `payload` came from [`allocate`](Self::allocate) of this allocator, and was not
    ///    deallocated since.
    /// 2. When shrinking, nothing uses the memory beyond `new_size` any more.
    pub(crate) unsafe fn reallocate_in_place(
        &mut self,
        payload: NonNull<u8>,
        new_size: usize,
    ) -> bool {
        let Some(needed) = block_size_for(new_size) else {
            return false;
        };
        // SAFETY: by (1) it is the payload of a used block of the tiling.
        let block = unsafe { Block::of_payload(payload) };
        let size_before = block.size();
        if needed > size_before {
            let next = block.next();
            // An end marker counts as used, so growth never leaves the region.
            if !next.is_free() || size_before + next.size() < needed {
                return false;
            }
            self.free.remove(next);
            block.absorb(next);
        }
        self.trim_back(block, needed);
        self.count_resize(size_before, block.size());
        true
    }

    /// Returns the memory in use, in bytes of whole blocks, 16-byte headers and rounding included:
    /// `capacity_bytes - in_use_bytes` is therefore the size of the free blocks.
    pub(crate) const fn usage(&self) -> HeapUsage {
        self.usage
    }

    /// Returns the part of `block` from its first aligned payload address on, and frees the part
    /// before, if any.
    fn trim_front(&mut self, block: Block, align: usize) -> Block {
        let misalignment = block.payload().addr().get().wrapping_neg() % align;
        let gap = match misalignment {
            0 => return block,
            // Too short to be a block itself: go one alignment step further.
            short if short < MIN_BLOCK_SIZE => short + align,
            enough => enough,
        };
        let aligned = block.split(gap);
        self.release(block);
        aligned
    }

    /// Frees the excess of `block` beyond `needed` bytes, if large enough for a block.
    fn trim_back(&mut self, block: Block, needed: usize) {
        if block.size() - needed >= MIN_BLOCK_SIZE {
            let rest = block.split(needed);
            self.release(rest);
        }
    }

    /// Merges a used block with its free neighbours and lists the result.
    fn release(&mut self, block: Block) {
        let mut merged = block;
        if let Some(previous) = block.previous().filter(|block| block.is_free()) {
            self.free.remove(previous);
            previous.absorb(block);
            merged = previous;
        }
        let next = merged.next();
        if next.is_free() {
            self.free.remove(next);
            merged.absorb(next);
        }
        self.free.insert(merged);
    }

    /// Counts a block's growth or shrinkage.
    fn count_resize(&mut self, size_before: usize, size_after: usize) {
        let usage = &mut self.usage;
        usage.in_use_bytes = usage.in_use_bytes - size_before + size_after;
        usage.peak_bytes = usage.peak_bytes.max(usage.in_use_bytes);
    }
}

/// The list of each class.
///
/// Bit `f` of `ranges` is set exactly when `classes[f]` is not zero; bit `s` of
/// `classes[f]` exactly when `heads[f][s]` is a block.
struct FreeLists {
    ranges: u32,
    classes: [u32; FIRST_LEVEL],
    heads: [[Option<Block>; SECOND_LEVEL]; FIRST_LEVEL],
}

const _: () = assert!(FIRST_LEVEL == 32 && SECOND_LEVEL == 32, "the bits of a u32");

impl FreeLists {
    const fn new() -> Self {
        Self {
            ranges: 0,
            classes: [0; FIRST_LEVEL],
            heads: [[None; SECOND_LEVEL]; FIRST_LEVEL],
        }
    }

    /// Takes a block of at least `size` bytes out of its list.
    fn take_free(&mut self, size: usize) -> Option<Block> {
        let class = self.first_nonempty_from(SizeClass::fitting(size)?)?;
        let block = self.head(class)?;
        self.remove(block);
        Some(block)
    }

    /// Lists a used block, and so makes the block free.
    fn insert(&mut self, block: Block) {
        debug_assert!(!block.is_free(), "a listed block cannot be listed again");
        let class = SizeClass::of(block.size());
        let after = self.head(class);
        block.set_links(FreeLinks {
            before: None,
            after,
        });
        if let Some(after) = after {
            after.set_links(FreeLinks {
                before: Some(block),
                ..after.links()
            });
        }
        block.set_free(true);
        self.set_head(class, Some(block));
    }

    /// Takes a free block out of its list, and so makes the block used.
    fn remove(&mut self, block: Block) {
        let FreeLinks { before, after } = block.links();
        if let Some(after) = after {
            after.set_links(FreeLinks {
                before,
                ..after.links()
            });
        }
        match before {
            Some(before) => before.set_links(FreeLinks {
                after,
                ..before.links()
            }),
            None => self.set_head(SizeClass::of(block.size()), after),
        }
        block.set_free(false);
    }

    /// Returns the first block in the list of a class.
    const fn head(&self, class: SizeClass) -> Option<Block> {
        self.heads[class.first][class.second]
    }

    /// Reports whether the bitmaps mark a class as nonempty.
    #[cfg(test)]
    const fn is_marked(&self, class: SizeClass) -> bool {
        let range = self.ranges >> class.first & 1 == 1;
        let list = self.classes[class.first] >> class.second & 1 == 1;
        debug_assert!(range == (self.classes[class.first] != 0));
        list
    }

    /// Returns the smallest nonempty class from `class` on: by one bit scan in its own range or, if
    /// the range is empty from there on, one each on both levels.
    fn first_nonempty_from(&self, class: SizeClass) -> Option<SizeClass> {
        let same_range = self.classes[class.first] & (u32::MAX << class.second);
        if same_range != 0 {
            return Some(SizeClass {
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
        Some(SizeClass { first, second })
    }

    fn set_head(&mut self, class: SizeClass, head: Option<Block>) {
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
