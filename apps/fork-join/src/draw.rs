//! Execution times drawn from a seed, the same on every machine.

use core::time::Duration;

use random::{Random, nth};

use crate::WCET;

/// The execution times of one parallel subtask, job by job.
///
/// Each parallel subtask has its own generator, so its draws do not depend on when another subtask
/// runs.
#[derive(Clone, Debug)]
pub struct ExecutionTimes {
    random: Random,
    longest_ns: u64,
}

impl ExecutionTimes {
    /// Starts the sequence of parallel subtask `branch` for `seed`.
    pub fn new(seed: u64, branch: usize) -> Self {
        Self::up_to(WCET, seed, branch)
    }

    /// Starts a sequence whose longest time, at least 1 ms, may differ from the paper's.
    pub fn up_to(longest: Duration, seed: u64, branch: usize) -> Self {
        let seed = nth(seed, branch as u64);
        Self {
            random: Random::new(seed),
            longest_ns: u64::try_from(longest.as_nanos()).unwrap_or(u64::MAX),
        }
    }

    /// Draws the next time: uniform from 1 ms to the longest, 50 ms in the paper.
    pub fn next_time(&mut self) -> Duration {
        let drawn = self.random.within(1_000_000..=self.longest_ns);
        Duration::from_nanos(drawn)
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
