//! The heap: every allocation of kernel and apps, in constant time.
//!
//! The heap serves the boot, commits and reports. Between a DAG's first release and its last
//! completion the kernel itself allocates nothing, and the counters here are the proof.
//!
//! An instance's allocations belong to its DAG; the word noted by the layer above for the running
//! instance tells which DAG ([`OWNER_BIT`]). After a run the kernel can therefore tell how much
//! memory faults have left in use.
//!
//! An app's function may use up the heap all the same. Subtasks therefore cannot have the last
//! [`RESERVE`]th of the heap: the rest serves the reports, and the app's main function.

use core::alloc::{GlobalAlloc, Layout};
use core::ops::Range;
use core::ptr::NonNull;

use front::report::HeapUsage;

use super::tlsf::Tlsf;
use crate::machine::spinlock::SpinLock;
use crate::machine::this_core;

static HEAP: SpinLock<Tlsf> = SpinLock::new(Tlsf::new());

/// Subtasks leave free the heap's capacity divided by this number.
const RESERVE: usize = 32;

/// The first bit of the owner in the noted word of a running instance.
pub const OWNER_BIT: u32 = 44;

/// Reports whether the allocating code may have `bytes` more. Interrupts are disabled.
fn may_have(heap: &Tlsf, bytes: usize) -> bool {
    let usage = heap.usage();
    let free = usage.capacity_bytes - usage.in_use_bytes;
    free.saturating_sub(usage.capacity_bytes / RESERVE) >= bytes || this_core::running().is_none()
}

/// The image's global allocator, installed by the `entry!` macro.
#[derive(Clone, Copy, Debug)]
pub struct KernelHeap;

/// Gives the heap memory to allocate from.
///
/// # Safety
///
/// The range is mapped as data and used by nobody else, for good.
pub unsafe fn add_memory(range: Range<u64>) {
    let length = usize::try_from(range.end - range.start).unwrap_or(0);
    if let Some(start) = NonNull::new(range.start as *mut u8) {
        // SAFETY: passed on from the caller.
        unsafe { HEAP.lock().add_region(start, length) };
    }
}

/// Returns the usage of the heap so far.
pub fn usage() -> HeapUsage {
    HEAP.lock().usage()
}

fn allocate(layout: Layout) -> Option<NonNull<u8>> {
    let mut heap = HEAP.lock();
    if !may_have(&heap, layout.size()) {
        return None;
    }
    let block = heap.allocate(layout)?;
    if let Some(word) = this_core::running() {
        let owner = u32::try_from(word >> OWNER_BIT).map_or(0, |owner| owner + 1);
        // SAFETY: it was allocated just now.
        unsafe { heap.set_owner(block, owner) };
    }
    Some(block)
}

/// Adds, for each of these owners, the bytes allocated by the owner and still in use, and forgets
/// all owners. Takes time for each block of the heap.
pub fn take_owned(owners: &mut [usize]) {
    HEAP.lock().take_owned(|owner, bytes| {
        if let Some(sum) = owners.get_mut(owner as usize - 1) {
            *sum += bytes;
        }
    });
}

// SAFETY: the allocator behind the lock gives each block to one owner until it
// is given back (invariant of `tlsf`), and needs no memory of its own.
unsafe impl GlobalAlloc for KernelHeap {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        allocate(layout).map_or(core::ptr::null_mut(), NonNull::as_ptr)
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
        let mut heap = HEAP.lock();
        if may_have(&heap, new_size.saturating_sub(layout.size())) {
            // SAFETY: the caller of `realloc` vouches that the block came from `alloc`
            // and that of it no more than `new_size` is used any longer.
            if unsafe { heap.reallocate_in_place(held, new_size) } {
                return block;
            }
        }
        // `allocate` takes the lock itself.
        drop(heap);
        let moved = Layout::from_size_align(new_size, layout.align())
            .ok()
            .and_then(allocate);
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
