//! Small random sets of every kind that the scheduler knows.

use sched_dag::{DagSpec, Order, Policy, Preemption, Priority, SchedulerOptions, SubtaskSpec};

use super::machine::Costs;
use crate::random::Random;

/// A set, the platform it runs on, and what that costs.
pub(super) struct Sample {
    pub(super) specs: Vec<DagSpec>,
    pub(super) options: SchedulerOptions,
    pub(super) costs: Costs,
}

/// Draws up to 4 DAGs of up to 8 subtasks on up to 5 cores: from light to full load, deadlines
/// below, at and beyond the period, priorities by DAG or by subtask, some subtasks that keep
/// their cores; and costs of up to a fifth of the least WCET.
pub(super) fn sample(random: &mut Random) -> Sample {
    let cores = random.within(1, 5);
    let count = random.within(1, 4);
    let pipelined = random.within(0, 2) == 0;
    let by_subtask = random.within(0, 3) == 0;
    let mixed = random.within(0, 5) == 0;
    let load = random.within(2, 8);
    let mut specs = Vec::new();
    for dag in 0..count {
        let mut spec = draw_dag(random, cores, count * load, pipelined);
        for subtask in &mut spec.subtasks {
            let number = if by_subtask { random.within(0, 4) } else { dag };
            subtask.priority = u32::try_from(number).ok().map(Priority);
            subtask.non_preemptive = mixed && random.within(0, 1) == 0;
        }
        if random.within(0, 3) == 0 {
            spec.order = Order::Fixed;
        }
        specs.push(spec);
    }
    let one_of_two = |random: &mut Random| random.within(0, 1) == 0;
    Sample {
        specs,
        options: SchedulerOptions {
            policy: match one_of_two(random) {
                true => Policy::StaticPriority,
                false => Policy::Edf,
            },
            preemption: match one_of_two(random) {
                true => Preemption::Enabled,
                false => Preemption::Disabled,
            },
            cores: u32::try_from(cores).unwrap_or(1),
        },
        costs: Costs {
            switch_ns: random.within(0, 50),
            dispatch_ns: random.within(0, 200),
            interrupt_ns: random.within(0, 200),
            ready_ns: random.within(0, 200),
            late_ns: random.within(0, 200),
        },
    }
}

fn draw_dag(random: &mut Random, cores: u64, share: u64, pipelined: bool) -> DagSpec {
    let wcets_ns: Vec<u64> = (0..random.within(1, 8))
        .map(|_| random.within(1_000, 9_000))
        .collect();
    let density = random.within(1, 6);
    let edges = random.edges(wcets_ns.len(), density);
    let volume: u64 = wcets_ns.iter().sum();
    let longest = wcets_ns.iter().copied().max().unwrap_or(1);
    let period = (volume * share).div_ceil(cores * 4) + random.within(0, 10_000);
    let (period, deadline) = if pipelined {
        let period = period.max(2 * longest);
        let more = random.within(0, period);
        (period, period * random.within(1, 4) + more)
    } else {
        let period = period.max(volume / cores + 2 * longest);
        (period, period - random.within(0, period / 4))
    };
    let subtask = |&wcet_ns: &u64| SubtaskSpec {
        wcet_ns: Some(wcet_ns),
        ..SubtaskSpec::default()
    };
    DagSpec {
        period_ns: Some(period),
        relative_deadline_ns: Some(deadline),
        offset_ns: random.within(0, 2) * random.within(0, period),
        subtasks: wcets_ns.iter().map(subtask).collect(),
        edges,
        ..DagSpec::default()
    }
}
