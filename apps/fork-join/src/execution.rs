//! Two ways to spend an execution time: simulating and computing.
//!
//! A computation takes the drawn time *on a core of its own*: the pace of one core is measured
//! before anything else runs. Next to other subtasks a computation may take longer, for instance
//! where instructions are counted or memory is shared.

use core::hint::black_box;
use core::time::Duration;

use fass::Occupation;

use crate::compute;

/// The way a parallel subtask spends its execution time.
#[derive(Clone, Copy, Debug)]
pub enum ExecutionWork {
    /// The subtask occupies its core, and its execution is simulated.
    Simulate(Occupation),
    /// The subtask computes.
    Compute(CorePace),
}

impl ExecutionWork {
    /// Executes for a time.
    pub(crate) fn execute_for(self, time: Duration) {
        match self {
            Self::Simulate(occupation) => fass::execute_for(time, occupation),
            Self::Compute(pace) => pace.compute_for(time),
        }
    }
}

/// The pace of a core without other work: the time of a round, and its result.
#[derive(Clone, Copy, Debug)]
pub struct CorePace {
    round_ns: u64,
    result: u64,
}

impl CorePace {
    /// The seed of every round.
    const SEED: u64 = 1;

    /// Measures this core's pace.
    pub fn measure() -> Self {
        const ROUNDS: u64 = 100;
        // The first round is slower: its code and data are not in the caches yet.
        let result = compute(1, Self::SEED);
        let start_ns = fass::now_ns();
        for _ in 0..ROUNDS {
            black_box(compute(1, Self::SEED));
        }
        let round_ns = (fass::now_ns() - start_ns) / ROUNDS;
        Self {
            round_ns: round_ns.max(1),
            result,
        }
    }

    /// Returns the time of a round, in nanoseconds.
    pub const fn round_ns(self) -> u64 {
        self.round_ns
    }

    /// Computes for `time`, as measured on an otherwise idle core, in whole rounds.
    ///
    /// # Panics
    ///
    /// If a result is wrong: something was damaged while others had the core.
    pub fn compute_for(self, time: Duration) {
        let ns = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        for _ in 0..ns.div_ceil(self.round_ns) {
            let result = compute(1, Self::SEED);
            assert_eq!(result, self.result, "what was computed is wrong");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "what was computed is wrong")]
    fn a_wrong_result_is_found() {
        let pace = CorePace {
            round_ns: 1000,
            result: 7,
        };
        pace.compute_for(Duration::from_nanos(1));
    }
}
