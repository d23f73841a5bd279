//! The overrun policies, as whole sequences of events.
//!
//! Every DAG here has T = D = 10; most are one subtask that executes for 25.

mod support;

use sched_dag::OverrunPolicy::{self, Abort, Queue, Skip};
use sched_dag::{DagSpec, Instance};
use support::hand::Hand;
use support::{ByDag, PREEMPTIVE, Spec, TWO_CORES, cores, dag, run};

/// A chain of two subtasks.
const CHAIN: &[(usize, usize)] = &[(0, 1)];

fn one_subtask(jobs: u64, in_flight: u32, overrun: OverrunPolicy) -> [DagSpec; 1] {
    [dag(10, 10, jobs, &[0], &[]).overrunning(in_flight, overrun)]
}

fn chain(jobs: u64, in_flight: u32, overrun: OverrunPolicy) -> [DagSpec; 1] {
    [dag(10, 10, jobs, &[1, 0], CHAIN).overrunning(in_flight, overrun)]
}

/// Job 0 executes for long, all others for 2.
fn long_once(execution_ns: u64) -> impl FnMut(Instance) -> u64 {
    move |instance| if instance.job == 0 { execution_ns } else { 2 }
}

#[test]
fn queue_releases_late_and_keeps_the_nominal_times() {
    run(&one_subtask(4, 1, Queue), PREEMPTIVE, long_once(25)).must_be(
        "0 released 0.0, ready 0.0.0, start 0.0.0 on 0
         10 queued 0.1
         11 missed 0.0
         20 queued 0.2
         21 missed 0.1
         25 finish 0.0.0, completed 0.0 Missed, released 0.1, ready 0.1.0, start 0.1.0 on 0
         27 finish 0.1.0, completed 0.1 Missed, released 0.2, ready 0.2.0, start 0.2.0 on 0
         29 finish 0.2.0, completed 0.2 Met
         30 released 0.3, ready 0.3.0, start 0.3.0 on 0
         32 finish 0.3.0, completed 0.3 Met
         released=4, completed=4, queued=2, misses=2, consecutive_misses=0
         most_consecutive_misses=2, skips=0, aborts=0",
    );
}

#[test]
fn queue_lets_the_given_number_of_jobs_overlap() {
    run(&chain(4, 2, Queue), cores(4), [9, 18]).must_be(
        "0 released 0.0
         10 released 0.1
         20 queued 0.2
         27 released 0.2
         30 queued 0.3
         45 released 0.3",
    );
}

#[test]
fn a_release_at_the_instant_of_a_completion_finds_the_room() {
    for overrun in [Queue, Skip, Abort] {
        run(&one_subtask(2, 1, overrun), PREEMPTIVE, 10).must_be(
            "0 released 0.0
             10 completed 0.0 Met, released 0.1
             20 completed 0.1 Met
             queued=0, skips=0",
        );
    }
}

#[test]
fn skip_drops_releases_and_keeps_the_jobs_numbers() {
    run(&one_subtask(4, 1, Skip), PREEMPTIVE, long_once(25)).must_be(
        "0 released 0.0, ready 0.0.0, start 0.0.0 on 0
         10 skipped 0.1
         11 missed 0.0
         20 skipped 0.2
         25 finish 0.0.0, completed 0.0 Missed
         30 released 0.3, ready 0.3.0, start 0.3.0 on 0
         32 finish 0.3.0, completed 0.3 Met
         released=2, completed=2, skips=2, misses=1, queued=0, aborts=0",
    );
}

#[test]
fn skip_is_over_when_the_last_release_is_skipped() {
    run(&one_subtask(2, 1, Skip), PREEMPTIVE, 15)
        .must_be("10 skipped 0.1\n15 completed 0.0 Missed\nskips=1");
}

#[test]
fn abort_lets_the_started_instance_end_and_cancels_the_rest() {
    run(&chain(3, 1, Abort), PREEMPTIVE, long_once(14)).must_be(
        "0 released 0.0, ready 0.0.0, start 0.0.0 on 0
         10 aborted 0.0, queued 0.1
         14 finish 0.0.0, cancelled 0.0.1, completed 0.0 Aborted, released 0.1, ready 0.1.0
         14 start 0.1.0 on 0
         16 finish 0.1.0, ready 0.1.1, start 0.1.1 on 0
         18 finish 0.1.1, completed 0.1 Met
         20 released 0.2, ready 0.2.0, start 0.2.0 on 0
         22 finish 0.2.0, ready 0.2.1, start 0.2.1 on 0
         24 finish 0.2.1, completed 0.2 Met
         released=3, completed=2, aborts=1, misses=0, queued=1",
    );
}

#[test]
fn abort_frees_the_slot_at_once_if_nothing_has_started() {
    // DAG 1 keeps the only core, so DAG 0's jobs never start before 25.
    let behind = dag(10, 10, 3, &[5, 5], CHAIN).overrunning(1, Abort);
    let specs = [behind, dag(100, 100, 1, &[0], &[])];
    run(&specs, PREEMPTIVE, ByDag([2, 25])).must_be(
        "0 released 0.0, released 1.0, start 1.0.0 on 0
         10 aborted 0.0, cancelled 0.0.0, cancelled 0.0.1, completed 0.0 Aborted, released 0.1
         20 aborted 0.1, cancelled 0.1.0, cancelled 0.1.1, completed 0.1 Aborted, released 0.2
         25 completed 1.0 Met, start 0.2.0 on 0
         27 start 0.2.1 on 0
         29 completed 0.2 Met
         aborts=2, queued=0",
    );
}

#[test]
fn abort_lets_a_preempted_instance_end_at_its_key() {
    // DAG 0 starts, is preempted by DAG 1 from 5 to 25, and aborted at 10.
    let low = dag(10, 10, 2, &[5, 5], CHAIN).overrunning(1, Abort);
    let specs = [low, dag(100, 100, 1, &[0], &[]).offset(5)];
    run(&specs, PREEMPTIVE, ByDag([8, 20])).must_be(
        "0 start 0.0.0 on 0
         5 suspend 0.0.0 on 0, start 1.0.0 on 0
         10 aborted 0.0, queued 0.1
         25 completed 1.0 Met, resume 0.0.0 on 0
         28 cancelled 0.0.1, completed 0.0 Aborted, start 0.1.0 on 0
         36 start 0.1.1 on 0
         44 completed 0.1 Missed",
    );
}

#[test]
fn abort_with_several_in_flight_takes_the_oldest_first() {
    // Two in flight; the first subtask is quick, the second takes 35.
    run(&chain(5, 2, Abort), TWO_CORES, [1, 35]).must_be(
        "0 released 0.0
         10 released 0.1
         20 aborted 0.0, queued 0.2
         30 aborted 0.1, queued 0.3
         36 cancelled 0.1.1, completed 0.0 Aborted, completed 0.1 Aborted, released 0.2
         36 released 0.3
         40 aborted 0.2, queued 0.4
         72 completed 0.2 Aborted, released 0.4
         107 completed 0.3 Missed
         142 completed 0.4 Missed",
    );
}

#[test]
fn abort_skips_the_oldest_waiting_if_all_in_flight_are_aborted() {
    run(&one_subtask(4, 1, Abort), PREEMPTIVE, long_once(35)).must_be(
        "0 released 0.0
         10 aborted 0.0, queued 0.1
         20 skipped 0.1, queued 0.2
         30 skipped 0.2, queued 0.3
         35 completed 0.0 Aborted, released 0.3
         37 completed 0.3 Met
         aborts=1, skips=2, misses=0",
    );
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
        Hand::new(&one_subtask(3, 1, overrun), PREEMPTIVE).must(&format!("25: {events}"));
    }
}
