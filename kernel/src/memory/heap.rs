//! The heap: every allocation of kernel and apps, in constant time.
//!
//! The heap serves the boot, commits and reports. Between a DAG's first release
//! and its last completion nothing of the kernel's allocates, and the counters
//! here are the proof.

use core::alloc::{GlobalAlloc, Layout};
use core::ops::Range;
use core::ptr::NonNull;

use super::tlsf::Tlsf;
use super::tlsf::Usage;
use crate::machine::spinlock::SpinLock;

static HEAP: SpinLock<Tlsf> = SpinLock::new(Tlsf::new());

/// The image's global allocator; the `entry!` macro makes it so.
#[derive(Clone, Copy, Debug)]
pub struct KernelHeap;

/// Gives the heap memory to allocate from.
///
/// # Safety
///
/// The range is mapped as data and used by nobody else, for good.
pub(crate) unsafe fn add_memory(range: Range<u64>) {
    let length = usize::try_from(range.end - range.start).unwrap_or(0);
    if let Some(start) = NonNull::new(range.start as *mut u8) {
        // SAFETY: passed on from the caller.
        unsafe { HEAP.lock().add_region(start, length) };
    }
}

/// Returns what has been allocated so far.
pub(crate) fn usage() -> Usage {
    HEAP.lock().usage()
}

// SAFETY: the allocator behind the lock gives each block to one owner until it
// is given back (invariant of `tlsf`), and needs no memory of its own.
unsafe impl GlobalAlloc for KernelHeap {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        HEAP.lock()
            .allocate(layout)
            .map_or(core::ptr::null_mut(), NonNull::as_ptr)
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        let Some(block) = NonNull::new(block) else {
            return;
        };
        // SAFETY: the caller of `dealloc` vouches that the block came from
        // `alloc` with this layout and is no longer used.
        unsafe { HEAP.lock().deallocate(block, layout) };
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        let Some(held) = NonNull::new(block) else {
            return block;
        };
        // SAFETY: the caller of `realloc` vouches that the block came from `alloc`
        // and that of it no more than `new_size` is used any longer.
        if unsafe { HEAP.lock().reallocate_in_place(held, new_size) } {
            return block;
        }
        let moved = Layout::from_size_align(new_size, layout.align())
            .ok()
            .and_then(|layout| HEAP.lock().allocate(layout));
        let Some(moved) = moved else {
            return core::ptr::null_mut();
        };
        // SAFETY: two blocks in use do not overlap, and only growing gets here.
        unsafe { held.copy_to_nonoverlapping(moved, layout.size()) };
        // SAFETY: as in `dealloc`; the contents have moved.
        unsafe { HEAP.lock().deallocate(held, layout) };
        moved.as_ptr()
    }
}
