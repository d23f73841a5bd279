//! A heap over memory of the host, with a walker that checks every invariant.
//!
//! The walker goes over both structures, the tiling and the lists, and compares
//! them; the tests call it after each step that they take.

use core::alloc::Layout;
use core::ptr::NonNull;

use super::super::block::{Block, HEADER_SIZE, MIN_BLOCK_SIZE};
use super::super::{GRANULE, Tlsf};
use crate::memory::tlsf::block::{FIRST_LEVEL, SECOND_LEVEL, SizeClass};
use front::report::HeapUsage;

/// Owns the memory of a heap, and frees it.
pub(super) struct TestHeap {
    tlsf: Tlsf,
    regions: Vec<TestRegion>,
    deallocations: u64,
}

/// The findings of a walk over the tiling.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct HeapWalk {
    pub(super) used_blocks: usize,
    /// The sizes of the free blocks, in bytes, in the order of the walk.
    pub(super) free_sizes: Vec<usize>,
}

struct TestRegion {
    memory: NonNull<u8>,
    layout: Layout,
}

impl TestHeap {
    /// A heap of one region per length, in bytes, each aligned to 4096 bytes.
    pub(super) fn new(lengths: &[usize]) -> Self {
        let mut heap = Self {
            tlsf: Tlsf::new(),
            regions: Vec::new(),
            deallocations: 0,
        };
        for &length in lengths {
            heap.add_region(length);
        }
        heap
    }

    pub(super) fn add_region(&mut self, length: usize) {
        let layout = Layout::from_size_align(length, 4096).expect("a sound layout");
        // SAFETY: no test asks for a region of zero bytes.
        let memory = unsafe { std::alloc::alloc(layout) };
        let memory = NonNull::new(memory).expect("memory of the host");
        // SAFETY: (1) it lives as long as the heap, (2) which alone uses it.
        unsafe { self.tlsf.add_region(memory, length) };
        self.regions.push(TestRegion { memory, layout });
    }

    pub(super) fn allocate(&mut self, size: usize, align: usize) -> Option<NonNull<u8>> {
        let layout = Layout::from_size_align(size, align).expect("a sound layout");
        self.tlsf.allocate(layout)
    }

    /// The tests pass what they got from `allocate`, before they deallocate it.
    pub(super) fn set_owner(&mut self, payload: NonNull<u8>, owner: u32) {
        // SAFETY: it came from `allocate`, and was not deallocated since.
        unsafe { self.tlsf.set_owner(payload, owner) };
    }

    /// Returns what blocks have owners: the owner and the size of each.
    pub(super) fn take_owned(&mut self) -> Vec<(u32, usize)> {
        let mut owned = Vec::new();
        self.tlsf
            .take_owned(|owner, bytes| owned.push((owner, bytes)));
        owned
    }

    /// The tests pass what they got from `allocate`, once, with its size.
    pub(super) fn deallocate(&mut self, payload: NonNull<u8>, size: usize, align: usize) {
        let layout = Layout::from_size_align(size, align).expect("a sound layout");
        // SAFETY: the tests keep the three promises.
        unsafe { self.tlsf.deallocate(payload, layout) };
        self.deallocations += 1;
    }

    /// The tests pass what they got from `allocate` and still hold.
    pub(super) fn reallocate_in_place(&mut self, payload: NonNull<u8>, new_size: usize) -> bool {
        // SAFETY: the tests keep the two promises.
        unsafe { self.tlsf.reallocate_in_place(payload, new_size) }
    }

    pub(super) fn usage(&self) -> HeapUsage {
        self.tlsf.usage()
    }

    /// Checks **Tiling**, **Listing**, the merging of neighbours and the counts.
    pub(super) fn validate(&self) -> HeapWalk {
        let mut walk = HeapWalk {
            used_blocks: 0,
            free_sizes: Vec::new(),
        };
        let mut used_bytes = 0;
        let mut free_blocks = Vec::new();
        for region in &self.regions {
            let first = region
                .memory
                .map_addr(|start| start.saturating_add(HEADER_SIZE));
            // SAFETY: it is the payload of the block that starts the region.
            let mut block = unsafe { Block::of_payload(first) };
            assert_eq!(block.previous(), None);
            let mut previous_is_free = false;
            let mut tiled = 0;
            // Bounded by the region: each block takes at least its minimum.
            while block.size() != 0 {
                assert!(block.size() >= MIN_BLOCK_SIZE);
                assert!(block.size().is_multiple_of(GRANULE));
                assert_eq!(block.next().previous(), Some(block), "Tiling");
                assert!(!(previous_is_free && block.is_free()), "unmerged");
                tiled += block.size();
                previous_is_free = block.is_free();
                if block.is_free() {
                    free_blocks.push(block);
                    walk.free_sizes.push(block.size());
                } else {
                    used_bytes += block.size();
                    walk.used_blocks += 1;
                }
                block = block.next();
            }
            assert_eq!(tiled, region.tileable(), "Tiling");
            assert!(!block.is_free(), "nothing may merge with an end marker");
        }
        self.validate_lists(&free_blocks);
        let usage = self.usage();
        assert_eq!(usage.in_use_bytes, used_bytes);
        assert_eq!(
            usage.capacity_bytes,
            self.regions.iter().map(TestRegion::tileable).sum::<usize>()
        );
        let outstanding = usage.allocations - self.deallocations;
        assert_eq!(usize::try_from(outstanding), Ok(walk.used_blocks));
        assert!(usage.peak_bytes >= used_bytes && usage.peak_bytes <= usage.capacity_bytes);
        walk
    }

    /// Checks that the lists hold exactly `free_blocks`, each in its class.
    fn validate_lists(&self, free_blocks: &[Block]) {
        let mut listed = 0;
        for (first, second) in
            (0..FIRST_LEVEL).flat_map(|first| (0..SECOND_LEVEL).map(move |second| (first, second)))
        {
            let class = SizeClass { first, second };
            let mut before = None;
            let mut next = self.tlsf.free.head(class);
            assert_eq!(self.tlsf.free.is_marked(class), next.is_some());
            while let Some(block) = next {
                assert!(free_blocks.contains(&block), "Listing");
                assert_eq!(SizeClass::of(block.size()), class, "Listing");
                assert_eq!(block.links().before, before, "Listing");
                listed += 1;
                assert!(listed <= free_blocks.len(), "a list runs in circles");
                before = Some(block);
                next = block.links().after;
            }
        }
        assert_eq!(listed, free_blocks.len(), "Listing");
    }
}

impl TestRegion {
    /// Bytes of its blocks: all but the end marker.
    fn tileable(&self) -> usize {
        self.layout.size() / GRANULE * GRANULE - HEADER_SIZE
    }
}

impl Drop for TestHeap {
    fn drop(&mut self) {
        for region in &self.regions {
            // SAFETY: it came from `alloc` with this layout, and its heap is gone.
            unsafe { std::alloc::dealloc(region.memory.as_ptr(), region.layout) };
        }
    }
}
