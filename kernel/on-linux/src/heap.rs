//! The program's allocator: the system's, with counts of its own.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed};

use front::report::HeapUsage;

/// The allocator of an app's program.
#[derive(Debug)]
pub struct Heap;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);
/// The allocations made in threads of a run.
static OF_RUNS: AtomicU64 = AtomicU64::new(0);
static IN_USE: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

/// Returns the number of allocations so far by threads that release or run jobs.
pub(crate) fn allocations_of_runs() -> u64 {
    OF_RUNS.load(Relaxed)
}

/// Returns the present and the peak use of memory, out of `capacity_bytes`.
pub(crate) fn usage(capacity_bytes: usize) -> HeapUsage {
    HeapUsage {
        allocations: ALLOCATIONS.load(Relaxed),
        in_use_bytes: IN_USE.load(Relaxed),
        peak_bytes: PEAK.load(Relaxed),
        capacity_bytes,
    }
}

fn count(bytes: usize) {
    ALLOCATIONS.fetch_add(1, Relaxed);
    if linux::is_of_run() {
        OF_RUNS.fetch_add(1, Relaxed);
    }
    let now = IN_USE.fetch_add(bytes, Relaxed) + bytes;
    if now > PEAK.load(Relaxed) {
        PEAK.fetch_max(now, Relaxed);
    }
}

// SAFETY: all is left to the system's allocator.
unsafe impl GlobalAlloc for Heap {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        // SAFETY: the caller keeps the contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        IN_USE.fetch_sub(layout.size(), Relaxed);
        // SAFETY: the caller keeps the contract.
        unsafe { System.dealloc(pointer, layout) }
    }
}
