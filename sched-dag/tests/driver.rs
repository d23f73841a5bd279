//! What drivers of a real machine meet and virtual time does not: completions
//! of instances that are preempted meanwhile, clocks that go back, mistakes.

mod support;

use sched_dag::CoreId;
use sched_dag::OverrunPolicy::{Abort, Queue, Skip};
use support::hand::Hand;
use support::{PREEMPTIVE, Spec, TWO_CORES, cores, dag, instance};

/// DAG 0, which DAG 1 preempts at 2.
fn preempted_at_2(count: u32) -> Hand {
    let urgent = dag(100, 100, 1, &[0], &[]).offset(2);
    let mut hand = Hand::new(
        &[dag(100, 100, 1, &[5, 5], &[(0, 1)]), urgent],
        cores(count),
    );
    hand.must("0: released 0.0, start 0.0.0 on 0");
    hand
}

#[test]
fn a_preempt_stands_right_before_the_start_on_its_core() {
    preempted_at_2(1).must(
        "2: released 1.0, suspend 0.0.0 on 0, start 1.0.0 on 0, runs=1.0.0
         5 finish: completed 1.0 Met, resume 0.0.0 on 0",
    );
}

#[test]
fn a_preempted_instance_may_complete() {
    // It had finished before the interrupt reached its core. Its successor is ready, but the core
    // belongs to DAG 1 now. Then that starts; nothing resumes what has completed.
    preempted_at_2(1).must(
        "2: released 1.0, suspend 0.0.0 on 0, start 1.0.0 on 0
         3 finish 0.0.0: runs=1.0.0
         6 finish: completed 1.0 Met, start 0.0.1 on 0
         7 finish: completed 0.0 Met, finished=true",
    );
}

#[test]
fn a_preempted_instance_may_complete_at_the_instant_of_its_preemption() {
    preempted_at_2(1).must(
        "2: released 1.0, suspend 0.0.0 on 0, start 1.0.0 on 0
         2 finish 0.0.0, finish 1.0.0: completed 1.0 Met, start 0.0.1 on 0",
    );
}

#[test]
fn of_several_preempted_instances_each_may_complete() {
    let urgent = dag(100, 100, 1, &[0, 1], &[]).offset(2);
    let low = dag(100, 100, 1, &[7, 8], &[]);
    // The largest key gives way first.
    Hand::new(&[low, urgent], TWO_CORES).must(
        "0: released 0.0, start 0.0.0 on 0, start 0.0.1 on 1
         2: released 1.0, suspend 0.0.1 on 1, start 1.0.0 on 1, suspend 0.0.0 on 0, start 1.0.1 on 0
         3 finish 0.0.1
         4 finish 1.0.1: resume 0.0.0 on 0
         5 finish 1.0.0: completed 1.0 Met, runs=0.0.0+-
         6 finish 0.0.0: completed 0.0 Met, finished=true",
    );
}

#[test]
fn a_clock_that_goes_back_stands_still() {
    preempted_at_2(1).must("50: released 1.0\n40: now=50");
}

#[test]
fn next_event_covers_releases_and_deadlines() {
    let mut hand = Hand::new(&[dag(10, 4, 2, &[0], &[])], PREEMPTIVE);
    assert_eq!(hand.scheduler.next_event_ns(), Some(0));
    hand.must(
        "0: released 0.0, next=5
         5: missed 0.0, next=10
         6 finish: completed 0.0 Missed
         10: released 0.1
         11 finish: completed 0.1 Met, next=never",
    );
}

#[test]
#[should_panic(expected = "dag 0 job 0 subtask 1 is completed and has not started")]
fn completing_what_has_not_started_is_refused() {
    preempted_at_2(1).must("1 finish 0.0.1");
}

#[test]
#[should_panic(expected = "complete each once")]
fn completing_twice_is_refused() {
    preempted_at_2(1).must("1 finish 0.0.0, finish 0.0.0");
}

#[test]
#[should_panic(expected = "dag 0 job 1 subtask 0")]
fn completing_another_job_is_refused() {
    preempted_at_2(1).must("1 finish 0.1.0");
}

#[test]
fn hundreds_of_cores_are_served() {
    let priorities: Vec<u32> = (0..500).collect();
    let mut hand = Hand::new(&[dag(1000, 1000, 1, &priorities, &[])], cores(300));
    hand.must("0: released 0.0");
    for core in 0..300 {
        assert_eq!(
            hand.scheduler.running(CoreId(core)),
            Some(instance(0, 0, core))
        );
    }
}

#[test]
fn an_idle_core_that_the_driver_prefers_is_taken_first() {
    // Core 1 would be; core 2 is taken if it is preferred, and a busy one is not.
    for (preferred, taken) in [(0, 1), (1, 1), (2, 2)] {
        preempted_at_2(3).must(&format!(
            "2 prefer {preferred}: released 1.0, start 1.0.0 on {taken}"
        ));
    }
}

#[test]
fn r1_releases_follow_the_nominal_grid_and_not_the_drivers_delay() {
    Hand::new(&[dag(10, 10, 3, &[0], &[])], PREEMPTIVE)
        .must("4: released 0.0, start 0.0.0 on 0, next=10");
}

#[test]
fn a_driver_that_comes_late_finds_every_release_and_every_miss_in_order() {
    let aborted = "released 0.0, missed 0.0, aborted 0.0, cancelled 0.0.0, completed 0.0 Aborted, \
                   released 0.1, missed 0.1, aborted 0.1, cancelled 0.1.0, completed 0.1 Aborted, \
                   released 0.2, start 0.2.0 on 0";
    for (overrun, events) in [
        (
            Queue,
            "released 0.0, missed 0.0, queued 0.1, missed 0.1, queued 0.2, start 0.0.0 on 0",
        ),
        (
            Skip,
            "released 0.0, missed 0.0, skipped 0.1, skipped 0.2, start 0.0.0 on 0",
        ),
        (Abort, aborted),
    ] {
        let one = dag(10, 10, 3, &[0], &[]).overrunning(1, overrun);
        Hand::new(&[one], PREEMPTIVE).must(&format!("25: {events}"));
    }
}
