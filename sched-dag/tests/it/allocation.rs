//! From the first release to the last completion nothing is allocated.

use std::sync::Arc;

use crate::counting::allocated;
use random::Random;
use sched_dag::virtual_time::{RunOutcome, VirtualTime, Workload};
use sched_dag::{
    CommitOptions, ConstructionPolicy, DagId, DagSpec, DagStatistics, Instance, OverrunPolicy,
    Policy, Preemption, SchedulerOptions, SubtaskSpec, verify,
};

/// A layered DAG of 40 subtasks, some of them perhaps pinned, that overruns now and then.
fn dag(random: &mut Random, overrun: OverrunPolicy, has_pins: bool) -> DagSpec {
    let edges = (1..40)
        .flat_map(|to| [(random.index(to), to), (random.index(to), to)])
        .collect();
    DagSpec {
        period_ns: Some(random.within(50..=200)),
        relative_deadline_ns: Some(random.within(50..=400)),
        in_flight: Some(3),
        overrun,
        jobs: Some(300),
        edges,
        subtasks: (0..40)
            .map(|place| SubtaskSpec {
                core: (has_pins && place % 3 == 0).then_some(place % 4),
                ..SubtaskSpec::default()
            })
            .collect(),
        ..DagSpec::default()
    }
}

/// Random execution times, and perhaps a fault now and then.
struct Work {
    random: Random,
    may_fail: bool,
}

impl Workload for Work {
    fn execute(&mut self, _instance: &mut Instance, _now_ns: u64) -> Option<u64> {
        Some(self.random.within(0..=50))
    }

    fn fails(&mut self, _instance: Instance) -> bool {
        self.may_fail && self.random.within(0..=2_999) == 0
    }
}

/// Runs a DAG of each overrun policy, with pins if the seed is even, and returns what they did.
fn run(seed: u64, policy: Policy, preemption: Preemption, may_fail: bool) -> [DagStatistics; 3] {
    let mut random = Random::new(seed);
    let overruns = [
        OverrunPolicy::Queue,
        OverrunPolicy::Skip,
        OverrunPolicy::Abort,
    ];
    let specs = overruns.map(|overrun| dag(&mut random, overrun, seed.is_multiple_of(2)));
    let options = CommitOptions::new(policy, 4).with_construction(ConstructionPolicy::any_graph());
    let verified = verify(&specs, &options).expect("right DAGs");
    let options = SchedulerOptions {
        policy,
        preemption,
        cores: 4,
    };
    let mut run = VirtualTime::new(&Arc::new(verified.task_set), options);
    let mut work = Work { random, may_fail };

    let before = allocated().0;
    let end = run.run(&mut work);
    let allocated = allocated().0 - before;

    assert_eq!(end, RunOutcome::Finished);
    assert_eq!(allocated, 0, "seed {seed}, {policy:?} {preemption:?}");
    [0, 1, 2].map(|dag| *run.scheduler_of(DagId(dag)).statistics(DagId(dag)))
}

#[test]
fn nothing_is_allocated_from_first_release_to_last_completion() {
    for policy in [Policy::StaticPriority, Policy::Edf] {
        for preemption in [Preemption::Enabled, Preemption::Disabled] {
            for seed in [1, 2] {
                let [queue, skip, abort] = run(seed, policy, preemption, false);
                // The run was worth counting: all policies had something to do.
                assert!(queue.queued > 0 && skip.skips > 0 && abort.aborts > 0);
            }
        }
    }
}

#[test]
fn nothing_is_allocated_when_dags_are_ended() {
    let runs = (1..=20).flat_map(|seed| run(seed, Policy::Edf, Preemption::Enabled, true));
    let sum = |(faults, dropped), of: DagStatistics| (faults + of.faults, dropped + of.dropped);
    let (faults, dropped) = runs.fold((0, 0), sum);
    assert!(faults > 20 && dropped > 0, "{faults} {dropped}");
}

#[test]
fn the_counter_counts() {
    let before = allocated().0;
    drop(std::hint::black_box(Box::new(1)));
    assert_eq!(allocated().0 - before, 1);
}
