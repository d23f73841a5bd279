//! Pieces of work that take drawn times.

use core::time::Duration;

use fass::execute_for;

use crate::Workload;

/// The work of one subtask, job by job.
#[derive(Clone, Debug)]
pub(crate) struct Crunch {
    workload: Workload,
    /// The generator's state: SplitMix64 (Steele, Lea and Flood, OOPSLA 2014).
    state: u64,
}

impl Crunch {
    /// Makes the work of subtask number `number` of the system.
    pub(crate) fn new(workload: &Workload, number: u64) -> Self {
        let state = workload.seed.wrapping_mul(0xd134_2543_de82_ef95);
        Self {
            workload: *workload,
            state: state.wrapping_add(number << 32),
        }
    }

    /// Does one piece of work: executes for between the least part of its WCET and
    /// nearly all of it. A hundredth is left for what the machine adds.
    pub(crate) fn work(&mut self) {
        let least = self.workload.least_percent.min(99);
        let per_mille = least * 10 + self.next() % ((99 - least) * 10 + 1);
        let ns = u64::try_from(self.workload.crunch.as_nanos()).unwrap_or(u64::MAX);
        let time = Duration::from_nanos(ns / 1000 * per_mille);
        execute_for(time, self.workload.occupation);
    }

    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.state;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }
}
