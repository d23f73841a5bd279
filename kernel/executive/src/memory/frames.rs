//! Physical memory in frames of 4 KiB, handed out from the boot memory map.
//!
//! Frames never come back: memory taken at boot and at a commit is meant to stay, and short-lived
//! memory comes from the heap.

use core::ops::Range;

use boot::{List, MAX_REGIONS, MemoryRegion};

/// The size of a frame, in bytes.
pub(crate) const FRAME: u64 = 4096;

/// No frame below this address is handed out: this memory is the firmware's, and holds the
/// trampoline's page.
const LOWEST: u64 = 1 << 20;

/// The frames not taken yet.
pub(crate) struct FreeFrames {
    /// Image and module may each cut a range of the map in two.
    free: List<(u64, u64), { MAX_REGIONS + 2 }>,
    /// The bytes of all usable memory, taken or not.
    total: u64,
}

impl FreeFrames {
    /// Creates the stock from the memory map, which ascends, less the `taken` ranges. The stock
    /// ascends likewise: memory below 4 GiB, required for the first page tables, goes first.
    pub(crate) fn new(map: &[MemoryRegion], taken: &[Range<u64>]) -> Self {
        let mut frames = Self {
            free: List::new((0, 0)),
            total: 0,
        };
        for region in map.iter().filter(|region| region.usable) {
            frames.total += region.end.saturating_sub(region.start);
            let start = region.start.max(LOWEST);
            for free in less(start..region.end, taken) {
                frames.add(free.start, free.end);
            }
        }
        frames
    }

    /// Adds the whole frames of `start..end`, if there are any.
    fn add(&mut self, start: u64, end: u64) {
        let (start, end) = (start.next_multiple_of(FRAME), end / FRAME * FRAME);
        if start < end {
            // Never full: its size counts every cut.
            let _ = self.free.push((start, end));
        }
    }

    /// Returns the bytes of all usable memory, taken or not.
    pub(crate) const fn total_bytes(&self) -> u64 {
        self.total
    }

    /// Takes `count` adjacent frames and returns the first frame's address.
    pub(crate) fn allocate(&mut self, count: u64) -> Option<u64> {
        let bytes = count.checked_mul(FRAME)?;
        let (start, _) = self
            .free
            .as_mut_slice()
            .iter_mut()
            .find(|(start, end)| end - *start >= bytes)?;
        let taken = *start;
        *start += bytes;
        Some(taken)
    }

    /// Takes the upper three quarters of the largest free range, for the heap.
    pub(crate) fn take_heap(&mut self) -> Option<Range<u64>> {
        let (start, end) = self
            .free
            .as_mut_slice()
            .iter_mut()
            .max_by_key(|(start, end)| end - start)?;
        let middle = (*start + (*end - *start) / 4).next_multiple_of(FRAME);
        let heap = middle..*end;
        *end = middle;
        (!heap.is_empty()).then_some(heap)
    }
}

/// Returns the rest of `whole` without the `taken` ranges, in ascending order.
pub(super) fn less(whole: Range<u64>, taken: &[Range<u64>]) -> impl Iterator<Item = Range<u64>> {
    let end = whole.end;
    let mut start = whole.start;
    core::iter::from_fn(move || {
        while start < end {
            let holes = taken.iter().filter(|hole| hole.end > start);
            let Some(hole) = holes.min_by_key(|hole| hole.start) else {
                return Some(core::mem::replace(&mut start, end)..end);
            };
            let left = core::mem::replace(&mut start, hole.end)..hole.start.min(end);
            if left.start < left.end {
                return Some(left);
            }
        }
        None
    })
}

#[cfg(test)]
#[allow(clippy::single_range_in_vec_init, reason = "one range is meant")]
mod tests {
    use super::*;

    const MIB: u64 = 1 << 20;

    fn region(start: u64, end: u64, usable: bool) -> MemoryRegion {
        MemoryRegion { start, end, usable }
    }

    #[test]
    fn leaves_out_low_memory_the_image_and_what_is_reserved() {
        let map = [
            region(0, 640 << 10, true),
            region(MIB, 4 * MIB, true),
            region(4 * MIB, 8 * MIB, false),
        ];
        let mut frames = FreeFrames::new(&map, &[2 * MIB..3 * MIB]);
        assert_eq!(frames.allocate(256), Some(MIB));
        assert_eq!(frames.allocate(256), Some(3 * MIB));
        assert_eq!(frames.allocate(1), None);
        assert_eq!(frames.total_bytes(), 640 * 1024 + 3 * MIB);
    }

    #[test]
    fn takes_whole_frames_only() {
        let mut frames =
            FreeFrames::new(&[region(2 * MIB + 1, 2 * MIB + 3 * FRAME - 1, true)], &[]);
        assert_eq!(frames.allocate(1), Some(2 * MIB + FRAME));
        assert_eq!(frames.allocate(1), None);
    }

    #[test]
    fn gives_the_heap_the_most_and_keeps_the_rest() {
        let mut frames = FreeFrames::new(&[region(4 * MIB, 8 * MIB, true)], &[]);
        assert_eq!(frames.take_heap(), Some(5 * MIB..8 * MIB));
        assert_eq!(frames.allocate(256), Some(4 * MIB));
        assert_eq!(frames.allocate(1), None);
    }

    #[test]
    fn cuts_out_what_is_taken_in_any_order() {
        let left = |taken: &[Range<u64>]| less(10..20, taken).collect::<Vec<_>>();
        let all = 10..20;
        assert_eq!(left(&[]), [all]);
        assert_eq!(left(&[16..18, 12..14]), [10..12, 14..16, 18..20]);
        assert_eq!(left(&[5..12, 19..30]), [12..19]);
        assert_eq!(left(&[11..15, 13..17]), [10..11, 17..20]);
        assert_eq!(left(&[0..30]), []);
        assert_eq!(left(&[0..5, 25..30]), [10..20]);
    }

    #[test]
    fn has_nothing_without_a_map() {
        let mut frames = FreeFrames::new(&[], &[]);
        assert_eq!(frames.allocate(1), None);
        assert_eq!(frames.take_heap(), None);
    }
}
