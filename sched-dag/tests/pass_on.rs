//! The short way from a completion, [`Scheduler::pass_on`](sched_dag::Scheduler::pass_on), where
//! something else happens at the same instant. That it comes to the same as the long way, also
//! where a release waits or a dispatch is owed, random walks tell (`properties`).

mod support;

use sched_dag::DagSpec;
use support::hand::Hand;
use support::{Spec, TWO_CORES, dag};

fn chain(period_ns: u64, deadline_ns: u64, jobs: u64) -> DagSpec {
    dag(period_ns, deadline_ns, jobs, &[0, 0], &[(0, 1)])
}

#[test]
fn a_deadline_or_a_release_of_the_same_instant_leaves_it_open() {
    for (deadline_ns, script) in [
        // The deadline itself is in time. A later miss is reported by the rest of the instant.
        (10, "10 hand 0.0.0: start 0.0.1 on 0, done=on 0"),
        (
            10,
            "11 hand 0.0.0: done=Some(Open)
             11: missed 0.0, start 0.0.1 on 0",
        ),
        // So is the sink's, and it reports its own miss.
        (
            10,
            "4 hand 0.0.0: start 0.0.1 on 0
             10 hand 0.0.1: completed 0.0 Met, done=Some(Idle)",
        ),
        (
            10,
            "4 hand 0.0.0: start 0.0.1 on 0
             11 hand 0.0.1: missed 0.0, completed 0.0 Missed, done=Some(Idle)",
        ),
        (200, "99 hand 0.0.0: start 0.0.1 on 0, done=on 0"),
        (
            200,
            "100 hand 0.0.0: done=Some(Open)
             100: released 0.1, start 0.0.1 on 0, start 0.1.0 on 1",
        ),
        // The job that is due is skipped by the rest of the instant, too.
        (
            200,
            "2 pause: off 0
             99 hand 0.0.0: start 0.0.1 on 0, done=on 0",
        ),
        (
            200,
            "2 pause: off 0
             100 hand 0.0.0: done=Some(Open)
             100: skipped 0.1, start 0.0.1 on 0",
        ),
    ] {
        let script = format!("0: released 0.0, start 0.0.0 on 0\n{script}");
        Hand::new(&[chain(100, deadline_ns, 2)], TWO_CORES).must(&script);
    }
}

#[test]
fn a_signal_of_the_same_instant_leaves_it_open() {
    let signalled = dag(5, 5, 2, &[0], &[]).sporadic();
    Hand::new(&[chain(100, 100, 1), signalled], TWO_CORES).must(
        "0: released 0.0
         7 signal 1, open
         7 hand 0.0.0: done=Some(Open)",
    );
}
