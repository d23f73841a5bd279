//! Random task sets from a seed, without any other crate.

use sched_dag::{DagSpec, Order, Policy, Preemption, Priority};

use crate::simulate::spec;

/// A small generator (xorshift64*): the same seed gives the same sets everywhere.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        // Mixed, so that neighbouring seeds differ at once; never 0.
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x6a09_e667_f3bc_c909 | 1)
    }

    /// Returns a number of `least..=most`.
    pub(crate) fn within(&mut self, least: u64, most: u64) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let mixed = self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 16;
        least + mixed % (most - least + 1)
    }

    fn index(&mut self, below: usize) -> usize {
        usize::try_from(self.within(0, below as u64 - 1)).expect("fits: it is below an index")
    }
}

/// A task set with the platform it runs on.
#[derive(Debug)]
pub(crate) struct Sample {
    pub(crate) specs: Vec<DagSpec>,
    pub(crate) policy: Policy,
    pub(crate) preemption: Preemption,
    pub(crate) cores: u32,
}

/// Draws a task set: up to 4 DAGs of up to 8 subtasks, from light to full load,
/// deadlines below, at and beyond the period, priorities by DAG or by subtask.
pub(crate) fn sample(random: &mut Random) -> Sample {
    let cores = random.within(1, 5);
    let count = random.within(1, 4);
    let pipelined = random.within(0, 2) == 0;
    let by_subtask = random.within(0, 3) == 0;
    let mixed = random.within(0, 5) == 0;
    let load = random.within(1, 8);
    let mut specs = Vec::new();
    for dag in 0..count {
        specs.push(draw_dag(random, cores, count * load, pipelined));
        let spec = specs.last_mut().expect("just pushed");
        let levels = random.within(1, 6);
        for subtask in &mut spec.subtasks {
            let number = if by_subtask {
                random.within(0, levels)
            } else {
                dag
            };
            subtask.priority = u32::try_from(number).ok().map(Priority);
            subtask.non_preemptive = mixed && random.within(0, 1) == 0;
        }
        if random.within(0, 3) == 0 {
            spec.order = Order::Fixed;
        }
        if random.within(0, 9) == 0 {
            spec.in_flight = u32::try_from(random.within(1, 2)).ok();
        }
    }
    Sample {
        specs,
        policy: [Policy::StaticPriority, Policy::Edf][random.index(2)],
        preemption: [Preemption::Enabled, Preemption::Disabled][random.index(2)],
        cores: u32::try_from(cores).expect("at most 5"),
    }
}

fn draw_dag(random: &mut Random, cores: u64, share: u64, pipelined: bool) -> DagSpec {
    let subtasks = usize::try_from(random.within(1, 8)).expect("at most 8");
    let wcets: Vec<u64> = (0..subtasks).map(|_| random.within(1, 9)).collect();
    let density = random.within(1, 6);
    let mut edges = Vec::new();
    for to in 1..subtasks {
        for from in 0..to {
            if random.within(0, density) == 0 {
                edges.push((from, to));
            }
        }
    }
    let volume: u64 = wcets.iter().sum();
    let longest = wcets.iter().max().copied().unwrap_or(1);
    let period = (volume * share).div_ceil(cores * 4) + random.within(0, 10);
    let (period, deadline) = if pipelined {
        let period = period.max(longest);
        (
            period,
            period * random.within(1, 4) + random.within(0, period),
        )
    } else {
        let period = period.max(volume / cores + longest);
        (period, period - random.within(0, period / 4))
    };
    let mut spec = spec(period, deadline, &wcets, &edges, 0);
    if random.within(0, 5) == 0 {
        for subtask in 0..subtasks {
            if edges.iter().all(|&(from, _)| from != subtask) && random.within(0, 2) > 0 {
                let least = longest.min(deadline).max(deadline / 4);
                spec.subtasks[subtask].relative_deadline_ns = Some(random.within(least, deadline));
            }
        }
    }
    spec.offset_ns = random.within(0, 2) * random.within(0, period);
    spec
}
