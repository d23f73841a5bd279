//! The rules E1 to E8: a DAG that is ended by a fault or a stop, as whole
//! sequences of events.

mod support;

use sched_dag::DagSpec;
use support::hand::Hand;
use support::{ByDag, PREEMPTIVE, Run, Spec, TWO_CORES, dag, run, run_failing};

/// 0 -> (1, 2) -> 3, every 10; the middle subtasks run in parallel.
fn diamond(jobs: u64) -> DagSpec {
    let edges = [(0, 1), (0, 2), (1, 3), (2, 3)];
    dag(10, 10, jobs, &[1, 1, 1, 1], &edges)
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
