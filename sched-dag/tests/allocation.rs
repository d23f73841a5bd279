//! From the first release to the last completion nothing is allocated.

#[path = "support/counting.rs"]
mod counting;
#[path = "support/random.rs"]
mod random;

use std::sync::Arc;

use counting::allocated;
use random::Random;
use sched_dag::virtual_time::{End, ExecutionTimes, VirtualTime, Workload};
use sched_dag::{
    CommitOptions, ConstructionPolicy, DagId, DagSpec, Instance, OverrunPolicy, Policy, Preemption,
    Scheduler, SchedulerOptions, SubtaskSpec, verify,
};

/// A layered DAG of 40 subtasks that overruns now and then.
fn dag(random: &mut Random, overrun: OverrunPolicy) -> DagSpec {
    let edges = (1..40)
        .flat_map(|to| [(random.below(to), to), (random.below(to), to)])
        .collect();
    DagSpec {
        period_ns: Some(random.between(50, 200)),
        relative_deadline_ns: Some(random.between(50, 400)),
        in_flight: Some(3),
        overrun,
        jobs: Some(300),
        edges,
        subtasks: vec![SubtaskSpec::default(); 40],
        ..DagSpec::default()
    }
}

#[test]
fn nothing_is_allocated_from_first_release_to_last_completion() {
    for policy in [Policy::StaticPriority, Policy::Edf] {
        for preemption in [Preemption::Enabled, Preemption::Disabled] {
            let mut random = Random::new(1);
            let specs = [
                OverrunPolicy::Queue,
                OverrunPolicy::Skip,
                OverrunPolicy::Abort,
            ]
            .map(|overrun| dag(&mut random, overrun));
            let commit_options =
                CommitOptions::new(policy, 4).with_construction(ConstructionPolicy::any_graph());
            let verified = verify(&specs, &commit_options).expect("right DAGs");
            let options = SchedulerOptions {
                policy,
                preemption,
                cores: 4,
            };
            let mut run = VirtualTime::new(Scheduler::new(Arc::new(verified.task_set), options));

            let before = allocated().0;
            let end = run.run(&mut ExecutionTimes(|_| random.between(0, 50)));
            let allocated = allocated().0 - before;

            assert_eq!(end, End::Finished);
            assert_eq!(allocated, 0, "{policy:?} {preemption:?}");
            // The run was worth counting: all policies had something to do.
            let counted = [0, 1, 2].map(|dag| *run.scheduler_of(DagId(dag)).statistics(DagId(dag)));
            assert!(counted[0].queued > 0 && counted[1].skips > 0 && counted[2].aborts > 0);
        }
    }
}

/// Random execution times, and a fault now and then.
struct Failing(Random);

impl Workload for Failing {
    fn execute(&mut self, _instance: &mut Instance, _now_ns: u64) -> Option<u64> {
        Some(self.0.between(0, 50))
    }

    fn fails(&mut self, _instance: Instance) -> bool {
        self.0.between(0, 2_999) == 0
    }
}

#[test]
fn nothing_is_allocated_when_dags_are_ended() {
    let mut faults = 0;
    let mut dropped = 0;
    for seed in 1..=20 {
        let mut random = Random::new(seed);
        let specs = [
            OverrunPolicy::Queue,
            OverrunPolicy::Queue,
            OverrunPolicy::Abort,
        ]
        .map(|overrun| dag(&mut random, overrun));
        let commit_options =
            CommitOptions::new(Policy::Edf, 4).with_construction(ConstructionPolicy::any_graph());
        let verified = verify(&specs, &commit_options).expect("right DAGs");
        let options = SchedulerOptions {
            policy: Policy::Edf,
            preemption: Preemption::Enabled,
            cores: 4,
        };
        let mut run = VirtualTime::new(Scheduler::new(Arc::new(verified.task_set), options));

        let before = allocated().0;
        let end = run.run(&mut Failing(random));
        let allocated = allocated().0 - before;

        assert_eq!(end, End::Finished);
        assert!(run.is_finished(), "seed {seed}");
        assert_eq!(allocated, 0, "seed {seed}");
        for counted in [0, 1, 2].map(|dag| run.scheduler_of(DagId(dag)).statistics(DagId(dag))) {
            faults += counted.faults;
            dropped += counted.dropped;
        }
    }
    assert!(faults > 20 && dropped > 0, "{faults} {dropped}");
}

#[test]
fn the_counter_counts() {
    let before = allocated().0;
    drop(std::hint::black_box(Box::new(1)));
    assert_eq!(allocated().0 - before, 1);
}
