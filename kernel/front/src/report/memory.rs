//! How much memory is, and was, in use.

use crate::text::json;

/// What of the machine's memory is in use while nothing runs.
///
/// See `Machine::resources`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resources {
    /// The bytes of the heap that are in use.
    pub heap_bytes: usize,
    /// The contexts, each with a stack, that there are for instances; none on Linux, where each
    /// run has its own threads.
    pub contexts: usize,
    /// How many of these can be taken: while nothing runs, all.
    pub contexts_free: usize,
}

/// What of its memory a program needs.
#[derive(Clone, Copy, Debug)]
pub struct Memory {
    /// The bytes of the heap that are in use.
    pub in_use_bytes: usize,
    /// The most that were.
    pub peak_bytes: u64,
    /// The bytes that there are.
    pub bytes: u64,
    /// How often memory was allocated.
    pub allocations: u64,
}

impl Memory {
    /// Prints what was needed.
    pub(crate) fn report(self) {
        crate::println!(
            "heap: {} KiB at its peak of {} KiB",
            self.peak_bytes.div_ceil(1024),
            self.bytes / 1024
        );
        json::emit("memory", |line| {
            line.number("heap_peak_bytes", self.peak_bytes)
                .number("heap_bytes", self.bytes)
                .number("allocations", self.allocations);
        });
    }
}
