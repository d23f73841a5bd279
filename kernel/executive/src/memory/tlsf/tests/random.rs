//! Random traces against a shadow of what the callers hold.
//!
//! The shadow knows address, size and pattern of each allocation. No two may
//! overlap, each must still hold its pattern when it is looked at, and when all
//! are returned each region must be one block again. A failing trace prints its
//! seed, which alone determines it.

use core::ptr::NonNull;
use std::collections::BTreeMap;

use super::heap::TestHeap;

const REGIONS: [usize; 3] = [256 * 1024, 64 * 1024, 5000];
const STEPS: usize = 3000;

/// Steele, Lea and Flood's SplitMix64, doi 10.1145/2660193.2660195.
struct Random(u64);

impl Random {
    /// A number below `bound`.
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^= mixed >> 31;
        usize::try_from(mixed).expect("a 64-bit host") % bound
    }

    /// A size in bytes: all orders of magnitude up to `2^log2` alike.
    fn size(&mut self, log2: usize) -> usize {
        let bound = 2 << self.below(log2);
        1 + self.below(bound)
    }
}

struct Held {
    payload: NonNull<u8>,
    size: usize,
    align: usize,
    pattern: u8,
}

impl Held {
    fn fill(&self) {
        // SAFETY: the heap says that these bytes are ours; that is under test.
        unsafe { self.payload.write_bytes(self.pattern, self.size) };
    }

    fn check(&self, size: usize) {
        let bytes = NonNull::slice_from_raw_parts(self.payload, size);
        // SAFETY: `fill` initialised these bytes, and no one writes them meanwhile.
        let bytes = unsafe { bytes.as_ref() };
        assert!(
            bytes.iter().all(|&byte| byte == self.pattern),
            "overwritten"
        );
    }
}

/// The heap, and what its callers hold, by address.
struct Trace {
    heap: TestHeap,
    held: BTreeMap<usize, Held>,
    random: Random,
}

impl Trace {
    fn new(seed: u64) -> Self {
        println!("seed {seed}");
        Self {
            heap: TestHeap::new(&REGIONS),
            held: BTreeMap::new(),
            random: Random(seed),
        }
    }

    /// Allocates more often than not until memory is short, then the reverse.
    fn run(&mut self) {
        for step in 0..STEPS {
            let growing = step / 500 % 2 == 0;
            match self.random.below(10) {
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

    fn allocate(&mut self) {
        let size = self.random.size(14);
        let align = 1 << self.random.below(13);
        let Some(payload) = self.heap.allocate(size, align) else {
            return;
        };
        assert!(payload.addr().get().is_multiple_of(align), "misaligned");
        let pattern = u8::try_from(self.random.below(256)).expect("below 256");
        self.hold(Held {
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
        let new_size = self.random.size(14);
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

    fn hold(&mut self, held: Held) {
        let start = held.payload.addr().get();
        let end = start + held.size;
        if let Some((_, before)) = self.held.range(..=start).next_back() {
            assert!(
                before.payload.addr().get() + before.size <= start,
                "overlap"
            );
        }
        if let Some((&after, _)) = self.held.range(start..).next() {
            assert!(end <= after, "overlap");
        }
        held.fill();
        self.held.insert(start, held);
    }

    fn pick(&mut self) -> Option<Held> {
        let index = self.random.below(self.held.len().max(1));
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
    for seed in 1..=40 {
        let mut trace = Trace::new(seed);
        trace.run();
        assert!(
            trace.heap.usage().allocations > 500,
            "hardly anything happened"
        );
        trace.finish();
    }
}

#[test]
fn random_traces_reach_exhaustion_and_recover() {
    for seed in 101..=110 {
        let mut trace = Trace::new(seed);
        let mut failures = 0;
        for _ in 0..STEPS {
            let before = trace.held.len();
            trace.allocate();
            failures += usize::from(trace.held.len() == before);
        }
        assert!(failures > STEPS / 2, "{failures} failures: never exhausted");
        trace.heap.validate();
        trace.run();
        trace.finish();
    }
}
