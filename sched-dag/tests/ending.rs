//! The rules E1 to E8: a DAG that is ended by a fault or a stop, as whole
//! sequences of events.

mod support;

use sched_dag::{DagSpec, OverrunPolicy};
use support::hand::Hand;
use support::{ByDag, PREEMPTIVE, Run, Spec, TWO_CORES, dag, run, run_failing};

/// 0 -> (1, 2) -> 3, every 10; the middle subtasks run in parallel.
fn diamond(jobs: u64) -> DagSpec {
    let edges = [(0, 1), (0, 2), (1, 3), (2, 3)];
    dag(10, 10, jobs, &[1, 1, 1, 1], &edges)
}

#[test]
fn e1_the_failing_instances_core_is_free_at_once() {
    let chain = dag(100, 100, 1, &[1, 1], &[(0, 1)]);
    run_failing(
        &[dag(100, 100, 1, &[0], &[]), chain],
        PREEMPTIVE,
        &["0.0.0"],
        5,
    )
    .must_be(
        "0 start 0.0.0 on 0
         5 ended 0.0.0, stopped 0, completed 0.0 DagEnded, start 1.0.0 on 0
         10 start 1.0.1 on 0
         15 completed 1.0 Met
         faults=1, cut_short=1, completed=0, faults@1=0, cut_short@1=0",
    );
}

#[test]
fn e1_an_instance_may_fail_while_its_preemption_is_under_way() {
    let urgent = dag(100, 100, 1, &[0], &[]).offset(2);
    Hand::new(&[dag(100, 100, 1, &[5, 5], &[(0, 1)]), urgent], PREEMPTIVE).must(
        "0: released 0.0, start 0.0.0 on 0
         2: released 1.0, suspend 0.0.0 on 0, start 1.0.0 on 0
         3 fail 0.0.0: stopped 0, cancelled 0.0.1, completed 0.0 DagEnded, runs=1.0.0, over=true
         4 finish: completed 1.0 Met, finished=true",
    );
}

#[test]
fn e2_nothing_is_released_from_the_instant_of_the_end_on() {
    run_failing(&[dag(10, 10, 3, &[0], &[])], PREEMPTIVE, &["0.1.0"], 10).must_be(
        "0 released 0.0
         10 completed 0.0 Met, released 0.1
         20 ended 0.1.0, stopped 0, completed 0.1 DagEnded
         released=2, dropped=0",
    );
}

#[test]
fn e2_waiting_releases_are_dropped_and_counted() {
    let spec = dag(10, 10, 9, &[0], &[]).overrunning(1, OverrunPolicy::Queue);
    run_failing(&[spec], PREEMPTIVE, &["0.0.0"], 35).must_be(
        "0 released 0.0
         10 queued 0.1
         11 missed 0.0
         20 queued 0.2
         21 missed 0.1
         30 queued 0.3
         31 missed 0.2
         35 ended 0.0.0, stopped 0, completed 0.0 DagEnded
         queued=3, dropped=3, released=1, cut_short=1, misses=3, consecutive_misses=3",
    );
}

#[test]
fn e3_and_e4_what_is_ready_is_cancelled_and_what_has_started_ends() {
    // Job 0's subtask 1 fails at 4 while subtask 2 runs until 8.
    run_failing(&[diamond(3)], TWO_CORES, &["0.0.1"], [1, 3, 7, 1]).must_be(
        "0 start 0.0.0 on 0
         1 finish 0.0.0, start 0.0.1 on 0, start 0.0.2 on 1
         4 ended 0.0.1, stopped 0
         8 finish 0.0.2, cancelled 0.0.3, completed 0.0 DagEnded",
    );
}

#[test]
fn e3_what_is_ready_is_cancelled_at_once() {
    // On one core subtask 2 is ready and waits while subtask 1 runs and fails.
    run_failing(&[diamond(3)], PREEMPTIVE, &["0.0.1"], 2).must_be(
        "0 ready 0.0.0
         2 ready 0.0.1, ready 0.0.2
         4 ended 0.0.1, stopped 0, cancelled 0.0.2, cancelled 0.0.3, completed 0.0 DagEnded",
    );
}

#[test]
fn e3_instances_of_all_jobs_in_flight_are_cancelled_once() {
    // The second subtask takes 25, so at 27 the jobs 1 and 2 wait for it.
    let spec = dag(10, 100, 9, &[0, 1, 2], &[(0, 1), (1, 2)]);
    run_failing(&[spec], TWO_CORES, &["0.0.1"], [2, 25, 1]).must_be(
        "0 ready 0.0.0
         2 ready 0.0.1
         10 ready 0.1.0
         20 ready 0.2.0
         27 ended 0.0.1, stopped 0
         27 cancelled 0.0.2, cancelled 0.1.1, cancelled 0.2.1, cancelled 0.1.2
         27 completed 0.0 DagEnded, cancelled 0.2.2, completed 0.1 DagEnded
         27 completed 0.2 DagEnded
         cut_short=3",
    );
}

#[test]
fn e4_a_preempted_instance_goes_on_at_its_key() {
    // On two cores DAG 0's subtask 0 is preempted by DAG 1 at 2, and its
    // subtask 1 fails at 4.
    let urgent = dag(100, 100, 1, &[0], &[]).offset(2);
    let specs = [dag(100, 100, 1, &[9, 1, 9], &[(0, 2), (1, 2)]), urgent];
    run_failing(&specs, TWO_CORES, &["0.0.1"], [[10, 4, 1], [20, 0, 0]]).must_be(
        "0 start 0.0.1 on 0, start 0.0.0 on 1
         2 suspend 0.0.0 on 1, start 1.0.0 on 1
         4 ended 0.0.1, stopped 0, resume 0.0.0 on 0
         12 cancelled 0.0.2, completed 0.0 DagEnded
         22 completed 1.0 Met
         faults=1",
    );
}

#[test]
fn e4_a_further_instance_may_fail() {
    run_failing(&[diamond(3)], TWO_CORES, &["0.0.1", "0.0.2"], [1, 3, 7, 1]).must_be(
        "4 ended 0.0.1, stopped 0
         8 ended 0.0.2, cancelled 0.0.3, completed 0.0 DagEnded
         faults=2, cut_short=1",
    );
}

#[test]
fn e5_a_job_that_was_aborted_before_ends_as_that() {
    let spec = dag(10, 10, 3, &[1, 0], &[(0, 1)]).overrunning(1, OverrunPolicy::Abort);
    run_failing(&[spec], PREEMPTIVE, &["0.0.0"], 14).must_be(
        "10 aborted 0.0
         14 ended 0.0.0, stopped 0, cancelled 0.0.1, completed 0.0 Aborted
         aborts=1, cut_short=0, dropped=1",
    );
}

#[test]
fn e5_a_job_that_is_complete_at_the_instant_of_the_end_counts() {
    // Job 0's sink and job 1's source end at 15.
    let spec = dag(10, 20, 2, &[0, 1], &[(0, 1)]);
    run_failing(&[spec], TWO_CORES, &["0.1.0"], [5, 10]).must_be(
        "5 finish 0.0.0
         15 finish 0.0.1, completed 0.0 Met
         15 ended 0.1.0, stopped 0, cancelled 0.1.1, completed 0.1 DagEnded",
    );
}

#[test]
fn e6_deadlines_count_up_to_the_end_and_no_further() {
    // The driver is not called between 0 and the failure.
    let end =
        "stopped 0, cancelled 0.0.1, cancelled 0.0.2, cancelled 0.0.3, completed 0.0 DagEnded";
    for (now_ns, missed, misses) in [
        (10, "", 0),
        (11, "missed 0.0, ", 1),
        (25, "missed 0.0, ", 1),
    ] {
        Hand::new(&[diamond(9)], TWO_CORES).must(&format!(
            "0: released 0.0
             {now_ns} fail: {missed}{end}, misses={misses}, released=1, next=never, finished=true
             1000: misses={misses}, released=1"
        ));
    }
}

#[test]
fn e7_the_others_are_scheduled_as_if_the_ended_dag_had_no_more_jobs() {
    let other = || dag(7, 7, 20, &[1, 2, 3], &[(0, 1), (0, 2)]);
    let of_the_other = |run: &Run| {
        let events = run.events.iter().copied();
        events.filter(|event| event.dag.0 == 1).collect::<Vec<_>>()
    };
    let (takes, failing) = (|| ByDag([3, 2]), dag(10, 10, 20, &[0], &[]));
    let with_fault = run_failing(&[failing, other()], TWO_CORES, &["0.3.0"], takes());
    let without = run(&[dag(10, 10, 4, &[0], &[]), other()], TWO_CORES, takes());
    assert_eq!(of_the_other(&with_fault), of_the_other(&without));
    without.must_be("completed@1=20");
}

#[test]
fn e8_an_ended_dag_stays_ended() {
    // The instance that has started keeps its core to its end.
    let specs = [diamond(1).endless(), dag(30, 30, 2, &[5], &[])];
    Hand::new(&specs, PREEMPTIVE).must(
        "0: released 0.0, released 1.0, ended=false, runs=0.0.0
         3 stop: stopped 0, ended=true, over=false, runs=0.0.0
         4 stop: runs=0.0.0
         5 finish: cancelled 0.0.1, cancelled 0.0.2, cancelled 0.0.3, completed 0.0 DagEnded
         5: runs=1.0.0, over=true, finished=false
         6 finish: completed 1.0 Met, next=30
         30: released 1.1, runs=1.1.0
         31 finish: completed 1.1 Met, finished=true, faults=0, cut_short=1, released=1",
    );
}

#[test]
fn a_stop_before_the_first_release_leaves_nothing_to_do() {
    Hand::new(&[diamond(3)], PREEMPTIVE)
        .must("0 stop: stopped 0, finished=true, next=never, released=0");
}

#[test]
#[should_panic(expected = "dag 0 job 0 subtask 1 fails and has not started")]
fn failing_what_has_not_started_is_refused() {
    Hand::new(&[diamond(1)], PREEMPTIVE).must("0: released 0.0\n1 fail 0.0.1");
}
