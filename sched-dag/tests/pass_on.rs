//! The short way from a completion, [`Scheduler::pass_on`](sched_dag::Scheduler::pass_on), where
//! something else happens at the same instant.

mod support;

use sched_dag::{DagSpec, OverrunPolicy, SchedulerOptions};
use support::hand::Hand;
use support::{PREEMPTIVE, Spec, TWO_CORES, dag};

fn chain(period_ns: u64, deadline_ns: u64, jobs: u64) -> DagSpec {
    dag(period_ns, deadline_ns, jobs, &[0, 0], &[(0, 1)])
}

fn must(specs: &[DagSpec], options: SchedulerOptions, script: &str) {
    Hand::new(specs, options).must(script);
}

#[test]
fn the_deadline_itself_is_in_time_and_the_next_instant_is_not() {
    // Both subtasks of one job with D = 10; the second one finishes.
    for last in [
        "10 hand 0.0.1: completed 0.0 Met, done=Some(Idle)",
        "11 hand 0.0.1: missed 0.0, completed 0.0 Missed, done=Some(Idle)",
    ] {
        let script = format!("0: released 0.0\n4 hand 0.0.0: done=on 0\n{last}");
        must(&[chain(100, 10, 2)], TWO_CORES, &script);
    }
}

#[test]
fn a_deadline_that_passes_meanwhile_leaves_the_instant_open() {
    // It is the rest of the instant that reports the miss.
    for first in [
        "10 hand 0.0.0: start 0.0.1 on 0, done=on 0",
        "11 hand 0.0.0: done=Some(Open)\n11: missed 0.0, start 0.0.1 on 0",
    ] {
        must(
            &[chain(100, 10, 2)],
            TWO_CORES,
            &format!("0: released 0.0, start 0.0.0 on 0\n{first}"),
        );
    }
}

#[test]
fn a_release_at_the_same_instant_leaves_it_open() {
    for first in [
        "99 hand 0.0.0: start 0.0.1 on 0, done=on 0",
        "100 hand 0.0.0: done=Some(Open)\n100: released 0.1, start 0.0.1 on 0, start 0.1.0 on 1",
    ] {
        must(
            &[chain(100, 200, 2)],
            TWO_CORES,
            &format!("0: released 0.0, start 0.0.0 on 0\n{first}"),
        );
    }
}

#[test]
fn a_release_that_has_waited_for_the_end_leaves_the_instant_open() {
    let spec = dag(10, 100, 3, &[0], &[]).overrunning(1, OverrunPolicy::Queue);
    must(
        &[spec],
        TWO_CORES,
        "0: released 0.0
         10: queued 0.1, waiting=1
         15 hand 0.0.0: completed 0.0 Met, done=Some(Open)",
    );
}

#[test]
fn a_signal_of_the_same_instant_leaves_it_open() {
    must(
        &[chain(100, 100, 1), dag(5, 5, 2, &[0], &[]).sporadic()],
        TWO_CORES,
        "0: released 0.0
         7 signal 1, open
         7 hand 0.0.0: done=Some(Open)",
    );
}

#[test]
fn a_successor_that_is_first_in_line_is_cancelled_with_its_dag() {
    // DAG 0 goes first; DAG 1 waits in line on one core.
    Hand::new(
        &[chain(100, 100, 1), dag(100, 100, 1, &[5], &[])],
        PREEMPTIVE,
    )
    .must(
        "0: released 0.0, released 1.0, start 0.0.0 on 0
         3 finish, stop: stopped 0, cancelled 0.0.1, completed 0.0 DagEnded, start 1.0.0 on 0",
    );
}

#[test]
fn what_an_ended_dag_had_started_hands_over_to_others() {
    must(
        &[chain(100, 100, 1), dag(100, 100, 1, &[5], &[])],
        TWO_CORES,
        "0: released 0.0, released 1.0
         1 hand 1.0.0: completed 1.0 Met
         2 stop: stopped 0
         3 hand 0.0.0: cancelled 0.0.1, completed 0.0 DagEnded, done=Some(Idle)",
    );
}

#[test]
fn a_paused_dags_job_in_flight_goes_on_by_hand() {
    // The job that is due at 10 is skipped by the rest of the instant. The core that has finished
    // is the one that became idle last.
    for end in [
        "9 hand 0.0.0: start 0.0.1 on 0, done=on 0",
        "10 hand 0.0.0: done=Some(Open)\n10: skipped 0.1, start 0.0.1 on 0",
    ] {
        let script = format!("0: released 0.0, start 0.0.0 on 0\n2 pause: off 0\n{end}");
        must(&[chain(10, 100, 5)], TWO_CORES, &script);
    }
}

#[test]
fn a_dispatch_that_is_owed_leaves_the_instant_open() {
    // Two run, two are in line; an instant without dispatch has made core 1 idle.
    must(
        &[dag(100, 100, 1, &[0, 1, 2, 3], &[])],
        TWO_CORES,
        "0: released 0.0
         5 finish 0.0.1, open
         5 hand 0.0.0: done=Some(Open)",
    );
}
