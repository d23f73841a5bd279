//! What drivers of a real machine may do and virtual time does not: mistakes, clocks that go back,
//! cores that are preferred. (That they come late, or end what has lost its core meanwhile,
//! random walks tell: `properties`.)

mod support;

use std::panic::catch_unwind;

use support::hand::Hand;
use support::{Spec, cores, dag};

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
fn a_clock_that_goes_back_stands_still() {
    preempted_at_2(1).must("50: released 1.0\n40: now=50");
}

#[test]
fn an_end_of_what_does_not_run_is_refused() {
    for (script, expected) in [
        (
            "1 finish 0.0.1",
            "dag 0 job 0 subtask 1 is completed and has not started",
        ),
        (
            "1 fail 0.0.1",
            "dag 0 job 0 subtask 1 fails and has not started",
        ),
        ("1 finish 0.0.0, finish 0.0.0", "complete each once"),
        ("1 finish 0.1.0", "dag 0 job 1 subtask 0"),
    ] {
        let run = catch_unwind(|| _ = preempted_at_2(1).must(script));
        let refused = run.expect_err(script);
        let said: &String = refused.downcast_ref().expect("a text");
        assert!(said.contains(expected), "{said}");
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
