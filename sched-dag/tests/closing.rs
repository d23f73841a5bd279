//! The rules C1 to C5: a DAG that comes to its end.

mod support;

use sched_dag::{DagSpec, OverrunPolicy};
use support::hand::Hand;
use support::{PREEMPTIVE, Spec, dag};

/// A job every 100 ns without end, due within 250 ns, at most one in flight.
fn spec() -> DagSpec {
    let spec = dag(100, 250, 1, &[1], &[]).endless();
    spec.overrunning(1, OverrunPolicy::Queue)
}

fn must(script: &str) {
    Hand::new(&[spec()], PREEMPTIVE).must(script);
}

#[test]
fn c1_a_closed_dag_releases_nothing_at_the_instant_of_a_release_neither() {
    must(
        "0: released 0.0
         10 finish: completed 0.0 Met
         100 close: closed 0, next=never
         500: released=1, skips=0",
    );
}

#[test]
fn c1_a_kept_signal_is_forgotten() {
    Hand::new(&[spec().sporadic()], PREEMPTIVE).must(
        "5 signal: released 0.0
         10 finish: completed 0.0 Met
         20 signal: next=105
         30 close: closed 0
         200: finished=true",
    );
}

#[test]
fn c2_what_waits_is_skipped_at_the_closing() {
    must(
        "0: released 0.0
         200: queued 0.1, queued 0.2, waiting=2
         240 close: closed 0, skipped 0.1, skipped 0.2
         250 finish: completed 0.0 Met, finished=true",
    );
}

#[test]
fn c3_what_is_in_flight_ends_and_may_be_late() {
    must(
        "0: released 0.0
         50 close: closed 0, finished=false, next=251
         251: missed 0.0
         260 finish: completed 0.0 Missed",
    );
}

#[test]
fn c4_a_closed_dag_is_over_when_nothing_is_in_flight() {
    must(
        "0: released 0.0
         50 close: closed 0, over=false
         60 finish: completed 0.0 Met, over=true, ended=false",
    );
    Hand::new(&[spec().sporadic()], PREEMPTIVE).must(
        "5 close: closed 0
         7 signal: signals=1, dropped_signals=1, over=true",
    );
}

#[test]
fn c5_a_closed_dag_is_neither_paused_nor_resumed_and_faults_end_it() {
    must(
        "0: released 0.0
         20 pause: off 0
         50 close: closed 0
         51 close
         52 pause
         53 resume
         60 fail: stopped 0, completed 0.0 DagEnded, ended=true, finished=true",
    );
}
