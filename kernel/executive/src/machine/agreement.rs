//! Whether the time stamp counters of all cores agree, found out while the cores start.
//!
//! A *stamp* is the latest reading of any core's counter. A core that sees it, reads its own
//! counter after that, and finds less, is *behind*: no order of events could explain it. How far
//! a counter is ahead cannot be told from the time that a stamp takes from core to core, but
//! then all others are behind it.

use core::fmt::{self, Display};
use core::sync::atomic::{AtomicU64, Ordering};

use super::this_core::{self, Core};
use super::{clock, cpu};

/// The most by which a counter may be behind: less than it takes a core to start what
/// another one has made ready.
const MOST_NS: u64 = 1_000;

/// How often a core compares before it begins to work; the boot processor does so as long as
/// it waits for the others.
const ROUNDS: u32 = 100;

static STAMP: LatestReading = LatestReading(AtomicU64::new(0));

/// Compares the counter of this core, `core`, a few times.
pub(super) fn compare_often(core: &Core) {
    for _ in 0..ROUNDS {
        compare(core);
        cpu::relax();
    }
}

/// Compares the counter of this core, `core`, with the stamp, and notes by how much it is behind.
pub(super) fn compare(core: &Core) {
    let behind = STAMP.meet(cpu::time_stamp_after_reads);
    core.behind_ticks.fetch_max(behind, Ordering::Relaxed);
}

/// Returns by how much the counter of any core has been behind another's, in nanoseconds.
#[inline(never)]
pub fn skew_ns() -> u64 {
    this_core::all().iter().map(behind_ns).max().unwrap_or(0)
}

fn behind_ns(core: &Core) -> u64 {
    clock::ticks_to_ns(core.behind_ticks.load(Ordering::Relaxed))
}

/// Returns the cores whose counters are too far behind, in words, or nothing if there are none.
pub fn disagreement() -> Option<impl Display> {
    let behind = || this_core::all().iter().map(behind_ns).zip(0..);
    (skew_ns() > MOST_NS).then(|| too_late(behind))
}

/// Says which of these cores are too far behind; each comes with its index.
fn too_late<C: Iterator<Item = (u64, u32)>>(cores: impl Fn() -> C) -> impl Display {
    fmt::from_fn(move |out| {
        for (behind_ns, core) in cores().filter(|(behind_ns, _)| *behind_ns > MOST_NS) {
            write!(out, " core {core} by {behind_ns} ns;")?;
        }
        Ok(())
    })
}

/// The latest reading of any counter.
struct LatestReading(AtomicU64);

impl LatestReading {
    /// Compares a counter, which `read` reads, with the stamp, and returns by how many ticks
    /// it is behind. If it is not, its reading is the stamp from now on.
    fn meet(&self, read: impl FnOnce() -> u64) -> u64 {
        let seen = self.0.load(Ordering::Acquire);
        let own = read();
        if own > seen {
            // Another core's later stamp may be lost here: it leaves its next one soon.
            self.0.store(own, Ordering::Release);
        }
        seen.saturating_sub(own)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_counter_that_is_behind_is_found_so() {
        let stamp = LatestReading(AtomicU64::new(0));
        for time in 100..200 {
            assert_eq!(stamp.meet(|| 10 * time), 0);
            assert_eq!(stamp.meet(|| 10 * time + 3), 0, "it looks a little later");
            assert_eq!(stamp.meet(|| 10 * time + 5 - 400), 398);
        }
    }

    #[test]
    fn all_others_are_behind_a_counter_that_is_ahead() {
        let stamp = LatestReading(AtomicU64::new(0));
        assert_eq!(stamp.meet(|| 5_000), 0, "it is core 2's");
        assert_eq!(stamp.meet(|| 100), 4_900, "core 0's");
        assert_eq!(stamp.meet(|| 110), 4_890, "core 1's");
        let cores = || [4_900, 4_890, 0, MOST_NS].into_iter().zip(0..);
        let words = too_late(cores).to_string();
        assert_eq!(words, " core 0 by 4900 ns; core 1 by 4890 ns;");
    }
}
