//! Cases of one or a few operations, where random traces do not show their effect:
//! those tell that blocks merge, that every alignment is served and its slack returned,
//! and that an exhausted heap recovers.

mod heap;
mod random;

use core::ptr::NonNull;

use super::Tlsf;
use front::report::HeapUsage;
use heap::TestHeap;

/// Bytes of a test region whose one block has `WHOLE` bytes.
const LENGTH: usize = 64 * 1024;
const WHOLE: usize = LENGTH - 16;

/// Three used blocks of 128 bytes, and free memory after them.
fn three_blocks(heap: &mut TestHeap) -> [NonNull<u8>; 3] {
    [(); 3].map(|()| heap.allocate(112, 8).expect("memory for three blocks"))
}

fn distance(from: NonNull<u8>, to: NonNull<u8>) -> usize {
    to.addr().get() - from.addr().get()
}

#[test]
fn a_heap_without_regions_has_nothing() {
    let mut heap = TestHeap::new(&[]);
    assert_eq!(heap.allocate(1, 1), None);
    assert_eq!(heap.usage(), HeapUsage::default());
    heap.validate();
}

#[test]
fn an_alignment_or_size_beyond_all_memory_fails() {
    let mut heap = TestHeap::new(&[LENGTH]);
    let huge = isize::MAX.unsigned_abs();
    assert_eq!(heap.allocate(huge, 1), None);
    assert_eq!(heap.allocate(1, huge / 2 + 1), None);
    assert_eq!(heap.allocate(1 << 40, 4096), None);
    assert_eq!(heap.allocate((1 << 40) - 17, 1), None);
    assert_eq!(heap.validate().free_sizes, [WHOLE]);
}

#[test]
fn a_block_has_its_owner_until_it_is_freed_or_the_owner_is_taken() {
    let mut heap = TestHeap::new(&[LENGTH]);
    let blocks = three_blocks(&mut heap);
    for (block, owner) in blocks.into_iter().zip([7, 0xff_ffff, 7]) {
        heap.set_owner(block, owner);
    }
    // Sizes, neighbours and lists are as if there were no owners.
    assert_eq!(heap.validate().used_blocks, 3);
    heap.deallocate(blocks[0], 112, 8);
    assert_eq!(heap.take_owned(), [(0xff_ffff, 128), (7, 128)]);
    assert_eq!(heap.take_owned(), []);
    let again = heap.allocate(112, 8).expect("it was freed");
    assert_eq!((again, heap.take_owned()), (blocks[0], Vec::new()));
    for block in blocks {
        heap.deallocate(block, 112, 8);
    }
    assert_eq!(heap.validate().free_sizes, [WHOLE]);
}

#[test]
fn a_block_of_the_least_fitting_class_is_taken() {
    let mut heap = TestHeap::new(&[LENGTH]);
    let [large, _, small] = [1008, 16, 240].map(|size| {
        let block = heap.allocate(size, 8).expect("memory");
        heap.allocate(16, 8).expect("memory between");
        block
    });
    heap.deallocate(small, 240, 8);
    heap.deallocate(large, 1008, 8);
    assert_eq!(heap.allocate(200, 8), Some(small));
    assert_eq!(heap.allocate(900, 8), Some(large));
    heap.validate();
}

#[test]
fn neighbouring_regions_never_merge() {
    let mut memory = [0_u128; 64];
    let start = NonNull::from(&mut memory).cast::<u8>();
    let mut tlsf = Tlsf::new();
    for half in [0, 512] {
        // SAFETY: 512 is within the 1024 bytes of the array.
        let start = unsafe { start.byte_add(half) };
        // SAFETY: (1) the array outlives the heap, (2) which alone uses it.
        unsafe { tlsf.add_region(start, 512) };
    }
    let layout = |size| core::alloc::Layout::from_size_align(size, 16).expect("sound");
    assert_eq!(tlsf.allocate(layout(500)), None);
    let halves = [480, 480].map(|size| tlsf.allocate(layout(size)).expect("a half"));
    for half in halves {
        // SAFETY: it was allocated above with this layout, and is not used.
        unsafe { tlsf.deallocate(half, layout(480)) };
    }
    assert_eq!(tlsf.allocate(layout(500)), None);
    assert_eq!(tlsf.usage().capacity_bytes, 2 * 496);
}

#[test]
fn the_ends_of_a_region_are_aligned_inwards() {
    let mut memory = [0_u128; 8];
    let start = NonNull::from(&mut memory).cast::<u8>();
    for (skip, length, capacity) in [
        (0, 128, 112),
        (1, 127, 96),
        (15, 100, 80),
        (0, 63, 32),
        (0, 47, 0),
        (1, 48, 0),
        (1, 7, 0),
        (0, 0, 0),
    ] {
        let mut tlsf = Tlsf::new();
        // SAFETY: no case skips more than the 128 bytes of the array.
        let region = unsafe { start.byte_add(skip) };
        // SAFETY: (1) the array outlives the heap, (2) which alone uses it.
        unsafe { tlsf.add_region(region, length) };
        assert_eq!(tlsf.usage().capacity_bytes, capacity, "{skip} {length}");
    }
}

#[test]
fn resizing_in_place_takes_and_returns_the_memory_after() {
    let mut heap = TestHeap::new(&[LENGTH]);
    let [first, second, third] = three_blocks(&mut heap);
    assert!(heap.reallocate_in_place(first, 112), "the same size");
    assert!(!heap.reallocate_in_place(first, 113), "the next is used");
    heap.deallocate(second, 112, 8);
    // The next is too small.
    assert!(!heap.reallocate_in_place(first, 241));
    assert!(heap.reallocate_in_place(first, 200));
    assert_eq!(heap.validate().free_sizes, [32, WHOLE - 384]);
    assert!(heap.reallocate_in_place(first, 240), "no rest");
    assert_eq!(heap.validate().free_sizes, [WHOLE - 384]);
    assert!(heap.reallocate_in_place(first, 0), "a smallest block");
    assert_eq!(heap.validate().free_sizes, [224, WHOLE - 384]);
    assert!(heap.reallocate_in_place(third, 10_000));
    assert!(!heap.reallocate_in_place(third, usize::MAX));
    assert!(!heap.reallocate_in_place(third, LENGTH));
    heap.deallocate(first, 0, 8);
    heap.deallocate(third, 10_000, 8);
    assert_eq!(heap.validate().free_sizes, [WHOLE]);
}

#[test]
fn usage_counts_whole_blocks_and_keeps_the_peak() {
    let mut heap = TestHeap::new(&[LENGTH]);
    let [first, second, third] = three_blocks(&mut heap);
    assert_eq!(distance(first, second), 128);
    assert_eq!(distance(second, third), 128);
    heap.deallocate(second, 112, 8);
    assert_eq!(heap.allocate(LENGTH, 8), None);
    heap.allocate(1, 8).expect("memory for a byte");
    let usage = HeapUsage {
        allocations: 4,
        in_use_bytes: 256 + 32,
        peak_bytes: 384,
        capacity_bytes: WHOLE,
    };
    assert_eq!(heap.usage(), usage);
}

#[test]
#[should_panic(expected = "is deallocated twice")]
#[cfg(debug_assertions)]
fn a_second_free_is_caught_in_debug_builds() {
    let mut heap = TestHeap::new(&[LENGTH]);
    let [first, ..] = three_blocks(&mut heap);
    heap.deallocate(first, 112, 8);
    heap.deallocate(first, 112, 8);
}
