//! Pieces of work that take drawn times.

use core::time::Duration;

use common::random::Random;
use fass::execute_for;

use crate::Workload;

/// The work of one subtask, job by job.
#[derive(Clone, Debug)]
pub(crate) struct Crunch {
    workload: Workload,
    random: Random,
}

impl Crunch {
    /// Makes the work of subtask number `number` of the system.
    pub(crate) fn new(workload: &Workload, number: u64) -> Self {
        let seed = workload.seed.wrapping_mul(0xd134_2543_de82_ef95);
        Self {
            workload: *workload,
            random: Random::new(seed.wrapping_add(number << 32)),
        }
    }

    /// Does one piece of work: executes for between the least part of its WCET and
    /// nearly all of it. A hundredth is left for what the machine adds.
    pub(crate) fn work(&mut self) {
        let least = self.workload.least_percent.min(99);
        let per_mille = least * 10 + self.random.number() % ((99 - least) * 10 + 1);
        let ns = u64::try_from(self.workload.crunch.as_nanos()).unwrap_or(u64::MAX);
        let time = Duration::from_nanos(ns / 1000 * per_mille);
        execute_for(time, self.workload.occupation);
    }
}
