//! The short ways from a completion: [`Scheduler::hand_off`](sched_dag::Scheduler::hand_off) and
//! [`Scheduler::hand_over`](sched_dag::Scheduler::hand_over), where something else happens at the
//! same instant.

mod support;

use sched_dag::{CoreId, DagSpec, OverrunPolicy, SchedulerOptions};
use support::hand::Hand;
use support::{PREEMPTIVE, Spec, TWO_CORES, cores, dag};

fn chain(period_ns: u64, deadline_ns: u64, jobs: u64) -> DagSpec {
    dag(period_ns, deadline_ns, jobs, &[0, 0], &[(0, 1)])
}

/// Goes through a script for each short way: `TAKER` is core 0, which has finished, or core 1.
fn both(specs: &[DagSpec], options: SchedulerOptions, script: &str) {
    for taker in ["0", "1"] {
        Hand::new(specs, options).must(&script.replace("TAKER", taker));
    }
}

#[test]
fn the_deadline_itself_is_in_time_and_the_next_instant_is_not() {
    // Both subtasks of one job with D = 10; the second one finishes.
    for last in [
        "10 hand 0.0.1 to TAKER: completed 0.0 Met, done=Some(Idle)",
        "11 hand 0.0.1 to TAKER: missed 0.0, completed 0.0 Missed, done=Some(Idle)",
    ] {
        let script = format!("0: released 0.0\n4 hand 0.0.0: done=on 0\n{last}");
        both(&[chain(100, 10, 2)], TWO_CORES, &script);
    }
}

#[test]
fn a_deadline_that_passes_meanwhile_leaves_the_instant_open() {
    // It is the rest of the instant that reports the miss.
    for first in [
        "10 hand 0.0.0 to TAKER: start 0.0.1 on TAKER, done=on TAKER",
        "11 hand 0.0.0 to TAKER: done=Some(Open)\n11: missed 0.0, start 0.0.1 on 0",
    ] {
        both(
            &[chain(100, 10, 2)],
            TWO_CORES,
            &format!("0: released 0.0, start 0.0.0 on 0\n{first}"),
        );
    }
}

#[test]
fn a_release_at_the_same_instant_leaves_it_open() {
    for first in [
        "99 hand 0.0.0 to TAKER: start 0.0.1 on TAKER, done=on TAKER",
        "100 hand 0.0.0 to TAKER: done=Some(Open)\n100: released 0.1, start 0.0.1 on 0, start 0.1.0 on 1",
    ] {
        both(
            &[chain(100, 200, 2)],
            TWO_CORES,
            &format!("0: released 0.0, start 0.0.0 on 0\n{first}"),
        );
    }
}

#[test]
fn a_release_that_has_waited_for_the_end_leaves_the_instant_open() {
    let spec = dag(10, 100, 3, &[0], &[]).overrunning(1, OverrunPolicy::Queue);
    both(
        &[spec],
        TWO_CORES,
        "0: released 0.0
         10: queued 0.1, waiting=1
         15 hand 0.0.0 to TAKER: completed 0.0 Met, done=Some(Open)",
    );
}

#[test]
fn a_signal_of_the_same_instant_leaves_it_open() {
    both(
        &[chain(100, 100, 1), dag(5, 5, 2, &[0], &[]).sporadic()],
        TWO_CORES,
        "0: released 0.0
         7 signal 1, open
         7 hand 0.0.0 to TAKER: done=Some(Open)",
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
    both(
        &[chain(100, 100, 1), dag(100, 100, 1, &[5], &[])],
        TWO_CORES,
        "0: released 0.0, released 1.0
         1 hand 1.0.0: completed 1.0 Met
         2 stop: stopped 0
         3 hand 0.0.0 to TAKER: cancelled 0.0.1, completed 0.0 DagEnded, done=Some(Idle)",
    );
}

#[test]
fn a_paused_dags_job_in_flight_goes_on_by_hand() {
    // The job that is due at 10 is skipped by the rest of the instant. The core that has finished
    // is the one that became idle last.
    for end in [
        "9 hand 0.0.0 to TAKER: start 0.0.1 on TAKER, done=on TAKER",
        "10 hand 0.0.0 to TAKER: done=Some(Open)\n10: skipped 0.1, start 0.0.1 on 0",
    ] {
        let script = format!("0: released 0.0, start 0.0.0 on 0\n2 pause: off 0\n{end}");
        both(&[chain(10, 100, 5)], TWO_CORES, &script);
    }
}

#[test]
fn the_core_that_was_to_go_on_stays_the_first_to_be_given_something() {
    let specs = [dag(100, 100, 1, &[0], &[]), dag(50, 50, 2, &[1], &[])];
    Hand::new(&specs, cores(3)).must(
        "0: released 0.0, released 1.0, start 0.0.0 on 0, start 1.0.0 on 1
         1 hand 0.0.0 to 2: completed 0.0 Met, done=Some(Idle)
         2 hand 1.0.0 to 2: completed 1.0 Met, done=Some(Idle)
         50: released 1.1, start 1.1.0 on 2",
    );
}

#[test]
fn cores_beyond_a_word_of_bits_take_over() {
    // A fork of as many branches as there are cores, and a join.
    let branches = 1..=130;
    let edges: Vec<_> = branches
        .flat_map(|branch| [(0, branch), (branch, 131)])
        .collect();
    let mut hand = Hand::new(&[dag(1_000, 1_000, 1, &[0; 132], &edges)], cores(130));
    hand.must("0: released 0.0\n1 hand 0.0.0 to 129: done=Some(Open)\n1");
    let running = |hand: &Hand, core| hand.scheduler.running(core).expect("a branch").subtask.0;
    // All finish; the last to do so, on core 63, hands the join to core 64.
    let last = CoreId(63);
    for core in (0..130).map(CoreId).filter(|&core| core != last) {
        let branch = running(&hand, core);
        hand.must(&format!("2 hand 0.0.{branch}: done=Some(Idle)"));
    }
    let branch = running(&hand, last);
    hand.must(&format!(
        "3 hand 0.0.{branch} to 64: start 0.0.131 on 64, done=on 64"
    ));
    assert_eq!(running(&hand, CoreId(64)), 131);
}

#[test]
fn a_dispatch_that_is_owed_leaves_the_instant_open() {
    // Two run, two are in line; an instant without dispatch has made core 1 idle.
    both(
        &[dag(100, 100, 1, &[0, 1, 2, 3], &[])],
        TWO_CORES,
        "0: released 0.0
         5 finish 0.0.1, open
         5 hand 0.0.0 to TAKER: done=Some(Open)",
    );
}

#[test]
#[should_panic(expected = "has to be idle")]
fn a_busy_core_cannot_take_over() {
    let specs = [chain(100, 100, 1), dag(100, 100, 1, &[5], &[])];
    Hand::new(&specs, TWO_CORES).must("0: released 0.0, released 1.0\n1 hand 0.0.0 to 1");
}
