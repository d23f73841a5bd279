//! Small random sets of every kind that the scheduler knows.

use common::random::Random;
use sched_dag::{DagSpec, Order, Policy, Preemption, SchedulerOptions};

use super::machine::Costs;
use crate::random::set;

/// Draws a set, the platform of up to 5 cores it runs on, and what that costs. Some subtasks keep their cores; a cost
/// is up to a fifth of the least WCET.
pub(super) fn sample(random: &mut Random) -> (Vec<DagSpec>, SchedulerOptions, Costs) {
    let cores = random.within(1..=5);
    let mut specs = set(random, 1_000, &[cores]);
    let mixed = random.once_in(6);
    for spec in &mut specs {
        for subtask in &mut spec.subtasks {
            subtask.non_preemptive = mixed && random.once_in(2);
        }
        if random.once_in(4) {
            spec.order = Order::Fixed;
        }
    }
    let options = SchedulerOptions {
        policy: random.one_of(&[Policy::StaticPriority, Policy::Edf]),
        preemption: random.one_of(&[Preemption::Enabled, Preemption::Disabled]),
        cores,
    };
    let costs = Costs {
        switch_ns: random.within(0..=50),
        dispatch_ns: random.within(0..=200),
        interrupt_ns: random.within(0..=200),
        ready_ns: random.within(0..=200),
        late_ns: random.within(0..=200),
    };
    (specs, options, costs)
}
