//! What a heap counts about itself.

/// How much of a heap is, was and can be in use.
///
/// Byte counts are of whole blocks, 16-byte headers and rounding included, so
/// that `capacity_bytes - in_use_bytes` is what the free blocks hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Usage {
    /// Allocations that succeeded since the start.
    pub allocations: u64,
    /// Deallocations since the start, at most `allocations`.
    pub deallocations: u64,
    /// Bytes of the blocks that are in use now.
    pub in_use_bytes: usize,
    /// The largest value that `in_use_bytes` ever had between two operations.
    pub peak_bytes: usize,
    /// Bytes of all blocks, used and free.
    pub capacity_bytes: usize,
}

impl Usage {
    pub(super) const fn new() -> Self {
        Self {
            allocations: 0,
            deallocations: 0,
            in_use_bytes: 0,
            peak_bytes: 0,
            capacity_bytes: 0,
        }
    }

    pub(super) fn count_allocation(&mut self, block_size: usize) {
        self.allocations += 1;
        self.count_resize(0, block_size);
    }

    pub(super) const fn count_deallocation(&mut self, block_size: usize) {
        self.deallocations += 1;
        self.in_use_bytes -= block_size;
    }

    pub(super) fn count_resize(&mut self, size_before: usize, size_after: usize) {
        self.in_use_bytes = self.in_use_bytes - size_before + size_after;
        self.peak_bytes = self.peak_bytes.max(self.in_use_bytes);
    }
}
