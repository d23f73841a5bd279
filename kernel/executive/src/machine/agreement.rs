//! Agreement of clocks: checks, while the cores start, whether their time stamp counters agree.
//!
//! A *stamp* is the latest reading of any core's counter. A core that sees a stamp, then reads its
//! own counter and finds a smaller value, is *behind*: no order of events could explain the
//! difference. A counter that is ahead cannot be recognized, because its lead looks the same as the
//! time a stamp takes from core to core; but then all other counters are behind.

use core::fmt::{self, Display};
use core::sync::atomic::{AtomicU64, Ordering};

use super::this_core::{self, Core};
use super::{clock, cpu};

/// The most nanoseconds a counter may be behind: less than a core takes to start an instance made
/// ready by another core.
const MOST_NS: u64 = 1_000;

/// How often a core compares before beginning to work; the boot processor compares as long as it
/// waits for the others.
const ROUNDS: u32 = 100;

static STAMP: LatestReading = LatestReading(AtomicU64::new(0));

/// Compares the counter of this core, `core`, a few times.
pub(super) fn compare_often(core: &Core) {
    for _ in 0..ROUNDS {
        compare(core);
        cpu::relax();
    }
}

/// Compares the counter of this core, `core`, with the stamp, and notes how far it is behind.
pub(super) fn compare(core: &Core) {
    let behind = STAMP.meet(cpu::time_stamp_after_reads);
    core.behind_ticks.fetch_max(behind, Ordering::Relaxed);
}

/// Returns the largest lag of any core's counter behind another's, in nanoseconds.
#[inline(never)]
pub fn skew_ns() -> u64 {
    this_core::all().iter().map(behind_ns).max().unwrap_or(0)
}

fn behind_ns(core: &Core) -> u64 {
    clock::ticks_to_ns(core.behind_ticks.load(Ordering::Relaxed))
}

/// Names the cores whose counters are too far behind, in words; `None` if there are none.
pub fn disagreement() -> Option<impl Display> {
    let behind = || this_core::all().iter().map(behind_ns).zip(0..);
    (skew_ns() > MOST_NS).then(|| too_late(behind))
}

/// Names the cores too far behind; each item is a lag in nanoseconds and the core's index.
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
    /// Compares a counter, read by `read`, with the stamp, and returns how many ticks the counter
    /// is behind. If not behind, its reading becomes the stamp.
    fn meet(&self, read: impl FnOnce() -> u64) -> u64 {
        // The stamp first: a counter read before a stamp may be smaller without being behind.
        let seen = self.0.load(Ordering::Acquire);
        let own = read();
        if own > seen {
            // Another core's later stamp may be lost here: that core leaves its next stamp soon.
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
