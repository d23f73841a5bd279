//! Execution times drawn from a seed, the same on every machine.

use core::time::Duration;

/// The execution times of one parallel subtask, job by job.
///
/// The generator is SplitMix64 (Steele, Lea, Flood, OOPSLA 2014,
/// doi 10.1145/2660193.2660195). Each parallel subtask has its own, so what one
/// draws does not depend on when another runs.
#[derive(Clone, Debug)]
pub struct ExecutionTimes {
    state: u64,
}

impl ExecutionTimes {
    /// Starts the sequence of parallel subtask `branch` for `seed`.
    #[must_use]
    pub fn new(seed: u64, branch: usize) -> Self {
        let mut seeds = Self { state: seed };
        let state = (0..=branch).fold(0, |_, _| seeds.next_u64());
        Self { state }
    }

    /// Draws the next time: uniform from 1 to 50 ms, in nanoseconds.
    pub fn next_time(&mut self) -> Duration {
        const LEAST_NS: u64 = 1_000_000;
        const MOST_NS: u64 = 50_000_000;
        let choices = u128::from(MOST_NS - LEAST_NS + 1);
        // The high part of the product maps the draw to the range without the
        // bias of a remainder (it is below 2^-38 here).
        let drawn = (u128::from(self.next_u64()) * choices) >> 64;
        Duration::from_nanos(LEAST_NS + u64::try_from(drawn).unwrap_or(0))
    }

    fn next_u64(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.state;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_uniformly_within_the_range() {
        let mut times = ExecutionTimes::new(7, 3);
        let drawn: Vec<_> = (0..10_000).map(|_| times.next_time().as_micros()).collect();
        assert!(drawn.iter().all(|us| (1_000..=50_000).contains(us)));
        let mean = drawn.iter().sum::<u128>() / 10_000;
        assert!(
            (25_000..26_000).contains(&mean),
            "mean {mean} us, not about 25,500"
        );
    }

    #[test]
    fn repeats_for_a_seed_and_differs_between_branches() {
        let first = |seed, branch| ExecutionTimes::new(seed, branch).next_time();
        assert_eq!(first(1, 0), first(1, 0));
        assert_ne!(first(1, 0), first(1, 1));
        assert_ne!(first(1, 0), first(2, 0));
    }
}
