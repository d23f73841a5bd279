//! Random traces against a shadow of what the callers hold.
//!
//! The shadow knows address, size and pattern of each allocation. No two may
//! overlap, each must still hold its pattern when it is looked at, and when all
//! are returned each region must be one block again. A failing trace prints its
//! seed, which alone determines it.

use core::ptr::NonNull;
use std::collections::BTreeMap;

use random::Random;

use super::heap::TestHeap;

const REGIONS: [usize; 3] = [256 * 1024, 64 * 1024, 5000];
const STEPS: usize = 3000;

/// Draws a size in bytes: all orders of magnitude up to `2^log2` alike.
fn size(random: &mut Random, log2: usize) -> usize {
    let bound = 2 << random.index(log2);
    1 + random.index(bound)
}

struct HeldBlock {
    payload: NonNull<u8>,
    size: usize,
    align: usize,
    pattern: u8,
}

impl HeldBlock {
    fn fill(&self) {
        // SAFETY: the heap says that these bytes are ours; that is under test.
        unsafe { self.payload.write_bytes(self.pattern, self.size) };
    }

    fn check(&self, size: usize) {
        let bytes = NonNull::slice_from_raw_parts(self.payload, size);
        // SAFETY: `fill` initialised these bytes, and no one writes them meanwhile.
        let bytes = unsafe { bytes.as_ref() };
        // Overwritten.
        assert!(bytes.iter().all(|&byte| byte == self.pattern));
    }
}

/// The heap, and what its callers hold, by address.
struct CheckedHeap {
    heap: TestHeap,
    held: BTreeMap<usize, HeldBlock>,
    random: Random,
}

impl CheckedHeap {
    fn new(seed: u64) -> Self {
        println!("seed {seed}");
        Self {
            heap: TestHeap::new(&REGIONS),
            held: BTreeMap::new(),
            random: Random::new(seed),
        }
    }

    /// Allocates more often than not until memory is short, then the reverse.
    fn run(&mut self) {
        for step in 0..STEPS {
            let growing = step / 500 % 2 == 0;
            match self.random.index(10) {
                0 => self.resize(),
                1..=3 => self.allocate(),
                4..=6 => self.deallocate(),
                _ if growing => self.allocate(),
                _ => self.deallocate(),
            }
            if step % 16 == 0 {
                self.heap.validate();
            }
        }
    }

    /// Allocates until hardly anything fits any more.
    fn exhaust(&mut self) {
        let mut failures = 0;
        for _ in 0..STEPS {
            let before = self.held.len();
            self.allocate();
            failures += usize::from(self.held.len() == before);
        }
        assert!(failures > STEPS / 2, "{failures} failures: never exhausted");
        self.heap.validate();
    }

    fn allocate(&mut self) {
        let size = size(&mut self.random, 14);
        let align = 1 << self.random.index(13);
        let before = self.heap.usage().in_use_bytes;
        let Some(payload) = self.heap.allocate(size, align) else {
            return;
        };
        assert!(payload.addr().get().is_multiple_of(align), "misaligned");
        // A header, and less than a smallest block that could not be returned.
        let taken = self.heap.usage().in_use_bytes - before;
        assert!(taken <= size.next_multiple_of(16) + 16 + 16, "{taken}");
        let pattern = self.random.within(0..=u8::MAX);
        self.hold(HeldBlock {
            payload,
            size,
            align,
            pattern,
        });
    }

    fn deallocate(&mut self) {
        let Some(held) = self.pick() else { return };
        held.check(held.size);
        self.heap.deallocate(held.payload, held.size, held.align);
    }

    fn resize(&mut self) {
        let new_size = size(&mut self.random, 14);
        let Some(mut held) = self.pick() else { return };
        let resized = self.heap.reallocate_in_place(held.payload, new_size);
        assert!(resized || new_size > held.size, "shrinking cannot fail");
        held.check(if resized {
            new_size.min(held.size)
        } else {
            held.size
        });
        if resized {
            held.size = new_size;
        }
        self.hold(held);
    }

    fn hold(&mut self, held: HeldBlock) {
        let start = held.payload.addr().get();
        let end = start + held.size;
        if let Some((_, before)) = self.held.range(..=start).next_back() {
            // Overlap.
            assert!(before.payload.addr().get() + before.size <= start);
        }
        if let Some((&after, _)) = self.held.range(start..).next() {
            assert!(end <= after, "overlap");
        }
        held.fill();
        self.held.insert(start, held);
    }

    fn pick(&mut self) -> Option<HeldBlock> {
        let index = self.random.index(self.held.len().max(1));
        let (&start, _) = self.held.iter().nth(index)?;
        self.held.remove(&start)
    }

    fn finish(mut self) {
        // Bounded: each turn returns one of the allocations held.
        while !self.held.is_empty() {
            self.deallocate();
        }
        let walk = self.heap.validate();
        assert_eq!(walk.used_blocks, 0);
        let whole = REGIONS.map(|length| length / 16 * 16 - 16);
        assert_eq!(walk.free_sizes, whole, "each region is one block again");
    }
}

#[test]
fn random_traces_keep_contents_apart_and_merge_at_the_end() {
    for seed in 1..=50 {
        let mut trace = CheckedHeap::new(seed);
        if seed > 40 {
            trace.exhaust();
        }
        trace.run();
        let allocations = trace.heap.usage().allocations;
        assert!(allocations > 500, "hardly anything happened");
        trace.finish();
    }
}
