//! The rules P1 to P5: a DAG that rests for a while.

mod support;

use sched_dag::{DagSpec, OverrunPolicy};
use support::hand::Hand;
use support::{PREEMPTIVE, Spec, dag};

/// A job every 100 ns, due within 250 ns, at most one in flight.
fn spec(jobs: u64, overrun: OverrunPolicy) -> DagSpec {
    dag(100, 250, jobs, &[1], &[]).overrunning(1, overrun)
}

fn hand(jobs: u64) -> Hand {
    Hand::new(&[spec(jobs, OverrunPolicy::Queue)], PREEMPTIVE)
}

#[test]
fn p1_a_paused_dag_skips_each_job_when_it_is_due() {
    use OverrunPolicy::{Abort, Queue, Skip};
    for overrun in [Queue, Skip, Abort] {
        // At the very instant of a release, too; a driver that comes late skips all.
        Hand::new(&[spec(9, overrun)], PREEMPTIVE).must(
            "0: released 0.0
             10 finish: completed 0.0 Met
             100 pause: off 0, skipped 0.1, paused=true, next=200
             200: skipped 0.2
             420: skipped 0.3, skipped 0.4, released=1, completed=1, skips=4, misses=0",
        );
    }
}

#[test]
fn p1_a_signal_to_a_paused_sporadic_dag_is_skipped() {
    Hand::new(&[spec(9, OverrunPolicy::Queue).sporadic()], PREEMPTIVE).must(
        "5 pause: off 0
         7 signal: skipped 0.0
         200 resume: on 0
         210 signal: released 0.1",
    );
}

#[test]
fn p2_what_waits_is_skipped_at_the_pause() {
    hand(9).must(
        "0: released 0.0
         100: queued 0.1
         200: queued 0.2
         240 pause: off 0, skipped 0.1, skipped 0.2, waiting=0
         250 finish: completed 0.0 Met
         300: skipped 0.3",
    );
}

#[test]
fn p2_a_deadline_that_passed_before_the_pause_is_a_miss() {
    // Both deadlines, 250 and 350, have passed unnoticed.
    hand(9).must(
        "0: released 0.0
         100: queued 0.1
         360 pause: missed 0.0, missed 0.1, off 0, skipped 0.1, skipped 0.2, skipped 0.3
         370 finish: completed 0.0 Missed, misses=2",
    );
}

#[test]
fn p3_what_is_in_flight_goes_on_and_may_be_late() {
    hand(9).must(
        "0: released 0.0
         50 pause: off 0, in_flight=1
         251: missed 0.0, skipped 0.1, skipped 0.2
         260 finish: completed 0.0 Missed, in_flight=0",
    );
}

#[test]
fn p4_releases_go_on_upon_the_old_grid() {
    // At the instant of a release the job is released; pausing twice and resuming twice is like
    // once.
    hand(9).must(
        "0: released 0.0
         10 finish: completed 0.0 Met
         50 pause: off 0
         100: skipped 0.1
         150 resume: on 0, paused=false, next=200
         200: released 0.2
         210 finish: completed 0.2 Met
         220 pause: off 0
         300 resume: on 0, released 0.3
         310 finish: completed 0.3 Met
         320 pause: off 0
         330 pause
         340 resume: on 0
         350 resume
         400: released 0.4",
    );
}

#[test]
fn p4_a_driver_that_comes_late_releases_nothing_of_the_pause() {
    // Jobs 1 and 2 were due at 100 and 200, while it was paused.
    hand(5).must(
        "0 pause: off 0, skipped 0.0
         250 resume: on 0, skipped 0.1, skipped 0.2
         300: released 0.3",
    );
}

#[test]
fn p5_a_paused_dag_comes_to_its_limit() {
    hand(3).must(
        "0: released 0.0
         50 pause: off 0
         200: skipped 0.1, skipped 0.2, finished=false
         210 finish: completed 0.0 Met, finished=true",
    );
}

#[test]
fn p5_an_ended_dag_is_not_paused() {
    hand(3).must(
        "0: released 0.0
         20 stop: stopped 0
         30 pause: paused=false
         40 resume
         500",
    );
}

#[test]
fn others_do_not_notice_a_pause() {
    let specs = [dag(100, 100, 4, &[2], &[]), dag(100, 100, 4, &[1], &[])];
    Hand::new(&specs, PREEMPTIVE).must("0 pause: off 0, skipped 0.0, released 1.0, runs=1.0.0");
}
