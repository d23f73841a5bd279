//! An allocator that counts, for the promise that a run allocates nothing.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

struct Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

static OF_ALL: AtomicU64 = AtomicU64::new(0);
/// Tells whether the calling thread is of those whose allocations are added up; without it, all are.
pub(crate) static COUNTED: OnceLock<fn() -> bool> = OnceLock::new();

thread_local! {
    static OF_THREAD: Cell<u64> = const { Cell::new(0) };
    static BYTES: Cell<usize> = const { Cell::new(0) };
}

/// Returns the number of this thread's allocations, their bytes, and the number of all
/// threads' that are counted.
pub(crate) fn allocated() -> (u64, usize, u64) {
    (OF_THREAD.get(), BYTES.get(), OF_ALL.load(Relaxed))
}

#[allow(unsafe_code, reason = "an allocator that counts is only possible so")]
// SAFETY: every call is passed on unchanged to the system's allocator, which keeps the trait's
// contract; the counters are initialized at compile time, so counting does not allocate. What
// grows comes here, too, for `realloc` is the trait's own, which calls these two.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        OF_THREAD.set(OF_THREAD.get() + 1);
        BYTES.set(BYTES.get() + layout.size());
        if COUNTED.get().is_none_or(|is_counted| is_counted()) {
            OF_ALL.fetch_add(1, Relaxed);
        }
        // SAFETY: the caller keeps `alloc`'s conditions, which are the same.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps `dealloc`'s conditions, which are the same.
        unsafe { System.dealloc(pointer, layout) }
    }
}
