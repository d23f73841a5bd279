//! How execution times are spent: simulated, or by computing.
//!
//! A computation is to take as long as was drawn *with a core for itself*: the pace of one
//! core is measured before anything else runs. Next to others it may take longer, as where
//! instructions are counted, or memory is shared.

use core::hint::black_box;
use core::time::Duration;

use fass::Occupation;

use crate::compute;

/// How a parallel subtask spends its execution time.
#[derive(Clone, Copy, Debug)]
pub enum ExecutionWork {
    /// It occupies its core, and its execution is simulated.
    Simulate(Occupation),
    /// It computes.
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

/// How much a core that is alone computes in a time, and what comes out of it.
#[derive(Clone, Copy, Debug)]
pub struct CorePace {
    round_ns: u64,
    result: u64,
}

impl CorePace {
    /// Of every round.
    const SEED: u64 = 1;

    /// Measures this core's pace.
    pub fn measure() -> Self {
        const ROUNDS: u64 = 100;
        // For the first time code and data come from further away.
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

    /// Returns how long a round takes.
    pub const fn round_ns(self) -> u64 {
        self.round_ns
    }

    /// Computes what takes this time on a core that is alone, in whole rounds.
    ///
    /// # Panics
    ///
    /// If a result is wrong: something was lost while others had the core.
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
