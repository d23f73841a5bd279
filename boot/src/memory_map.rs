//! The machine's memory map, put in order.
//!
//! A firmware may name ranges in any order, in hundreds of pieces, and overlapping. In order, the
//! ranges ascend without overlaps, and adjacent ranges of a kind are merged. A piece named several
//! times is memory only if every range naming it is memory.

use crate::List;

/// The most ranges kept.
pub const MAX_REGIONS: usize = 128;

/// The end of memory usable by the kernel: from 512 GiB on, a virtual address no longer equals the
/// physical address behind it.
pub const MEMORY_END: u64 = 1 << 39;

/// A range of physical memory of a single kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryRegion {
    /// The address of the first byte.
    pub start: u64,
    /// The address after the last byte.
    pub end: u64,
    /// Whether the range is ordinary memory that nobody uses.
    pub usable: bool,
}

const FILLER: MemoryRegion = MemoryRegion {
    start: 0,
    end: 0,
    usable: false,
};

/// The ranges told by a loader.
pub struct MemoryMap {
    regions: List<MemoryRegion, MAX_REGIONS>,
    /// Whether some ranges did not fit.
    pub is_cut: bool,
}

impl MemoryMap {
    pub(crate) const fn new() -> Self {
        Self {
            regions: List::new(FILLER),
            is_cut: false,
        }
    }

    /// Returns the ranges.
    pub fn as_slice(&self) -> &[MemoryRegion] {
        self.regions.as_slice()
    }

    /// Adds a range. If there is no room, the ranges are put in order first, which leaves fewer
    /// ranges.
    pub(crate) fn add(&mut self, start: u64, size: u64, usable: bool) {
        let end = start.saturating_add(size).min(MEMORY_END);
        let region = MemoryRegion { start, end, usable };
        if start < end && !self.push(region) {
            self.put_in_order();
            self.is_cut |= !self.push(region);
        }
    }

    /// Appends a range, and reports whether there was room. A range continuing the last range of
    /// the same kind is merged with it.
    fn push(&mut self, region: MemoryRegion) -> bool {
        if let Some(last) = self.regions.as_mut_slice().last_mut()
            && (last.end, last.usable) == (region.start, region.usable)
        {
            last.end = region.end;
            return true;
        }
        self.regions.push(region).is_ok()
    }

    /// Puts the ranges in order, going from each beginning or end of a range to the next such
    /// place.
    #[inline(never)]
    pub fn put_in_order(&mut self) {
        let told = self.regions;
        let told = told.as_slice();
        self.regions = List::new(FILLER);
        let mut start = 0;
        let ends = |region: &MemoryRegion| [region.start, region.end];
        while let Some(end) = told.iter().flat_map(ends).filter(|at| *at > start).min() {
            let here = told.iter().filter(|it| it.start <= start && start < it.end);
            // Where ranges overlap, the reserved one counts: `false` is the smaller.
            if let Some(usable) = here.map(|region| region.usable).min() {
                self.is_cut |= !self.push(MemoryRegion { start, end, usable });
            }
            start = end;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use random::Random;

    /// Adds ranges (start, end, whether usable) and puts them in order.
    fn ordered(told: impl IntoIterator<Item = (u64, u64, bool)>) -> (Vec<(u64, u64, bool)>, bool) {
        let mut map = MemoryMap::new();
        for (start, end, usable) in told {
            map.add(start, end - start, usable);
        }
        map.put_in_order();
        let regions = map.as_slice().iter();
        let regions = regions.map(|it| (it.start, it.end, it.usable));
        (regions.collect(), map.is_cut)
    }

    #[test]
    fn hundreds_of_pieces_become_few() {
        // Every second piece first, so that nothing continues what came last.
        let pieces = |count| (0..count).step_by(2).chain((1..count).step_by(2));
        let map = |count| ordered(pieces(count).map(|at| (at, at + 1, true)));
        assert_eq!(map(254), (vec![(0, 254, true)], false));
        let (regions, is_cut) = map(400);
        assert_eq!((regions.len(), is_cut), (128, true), "no two adjoin");
        let descending = (0..400).rev().map(|at| (at, at + 1, at < 300));
        let (regions, is_cut) = ordered(descending);
        assert_eq!(regions, [(0, 300, true), (300, 400, false)]);
        assert!(!is_cut);
    }

    #[test]
    fn what_the_kernel_cannot_reach_is_left_out() {
        let far = [
            (MEMORY_END - 5, MEMORY_END + 5, true),
            (MEMORY_END, u64::MAX, true),
            (7, 7, true),
        ];
        assert_eq!(
            ordered(far),
            (vec![(MEMORY_END - 5, MEMORY_END, true)], false)
        );
    }

    /// Compares with a map that is kept byte by byte.
    #[test]
    fn any_map_is_what_its_bytes_say() {
        let mut random = Random::new(1);
        for _ in 0..1000 {
            let count = random.index(12);
            let one = |_| {
                let start = random.within(0..=39);
                (start, start + random.within(0..=19), random.once_in(2))
            };
            let told: Vec<_> = (0..count).map(one).collect();
            let kind = |at: u64, map: &[(u64, u64, bool)]| {
                let here = map.iter().filter(|it| it.0 <= at && at < it.1);
                here.map(|it| it.2).min()
            };
            let (regions, _) = ordered(told.clone());
            let is_so = |at| kind(at, &regions) == kind(at, &told);
            assert!((0..60).all(is_so), "{told:?}");
            let apart = |it: &[(u64, u64, bool)]| {
                it[0].1 <= it[1].0 && (it[0].1, it[0].2) != (it[1].0, it[1].2)
            };
            assert!(regions.windows(2).all(apart), "{regions:?}");
        }
    }
}
