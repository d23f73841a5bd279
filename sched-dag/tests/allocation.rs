//! From the first release to the last completion nothing is allocated.

#[path = "support/random.rs"]
mod random;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;

use random::Random;
use sched_dag::virtual_time::{End, ExecutionTimes, VirtualTime, Workload};
use sched_dag::{
    CommitOptions, ConstructionPolicy, DagId, DagSpec, Instance, OverrunPolicy, Policy, Preemption,
    Scheduler, SchedulerOptions, SubtaskSpec, verify,
};

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// Counts the allocations of each thread.
struct Counting;

fn count() {
    ALLOCATIONS.with(|allocations| allocations.set(allocations.get() + 1));
}

#[allow(unsafe_code, reason = "an allocator that counts is only possible so")]
// SAFETY: every method hands its arguments to `System` unchanged and returns
// what `System` returns; counting touches a `Cell` that is initialized at
// compile time, so it does not allocate.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller keeps `GlobalAlloc::alloc`'s contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps `GlobalAlloc::dealloc`'s contract, and the
        // pointer came from `System` by the methods here.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: the caller keeps `GlobalAlloc::realloc`'s contract, and the
        // pointer came from `System` by the methods here.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

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

            let before = ALLOCATIONS.get();
            let end = run.run(&mut ExecutionTimes(|_| random.between(0, 50)));
            let allocated = ALLOCATIONS.get() - before;

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

        let before = ALLOCATIONS.get();
        let end = run.run(&mut Failing(random));
        let allocated = ALLOCATIONS.get() - before;

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
    let before = ALLOCATIONS.get();
    drop(std::hint::black_box(Box::new(1)));
    assert_eq!(ALLOCATIONS.get() - before, 1);
}
