//! Traces whose oldest events were overwritten.

use super::*;

const HEADER: &str = r#"
{"kind":"trace_begin","policy":"static","preemption":"on","cores":2,"run":0}
{"kind":"trace_dag","dag":0,"name":"chain","period_ns":100,"relative_deadline_ns":100,"offset_ns":0,"in_flight":1,"overrun":"queue","subtasks":[["a",0,0,null],["b",1,0,null]],"edges":[[0,1]]}"#;

/// How `a` was started is lost.
const REST: &str = "
19 missed c0 0.7
20 finish c1 0.0.0
20 ready c1 0.0.1
21 start c0 0.0.1
30 finish c0 0.0.1
30 completed c0 0.0
";

fn lossy(events: &str) -> Run {
    Run {
        lost: 1,
        ..run_of(HEADER, events)
    }
}

#[test]
fn without_a_loss_the_gap_is_a_breach() {
    assert!(!breaches(&run_of(HEADER, REST)).is_empty());
}

#[test]
fn judged_is_what_came_after_the_gap() {
    let run = lossy(REST);
    assert_eq!(breaches(&run), [""; 0]);
    let figures = check(&run, BOUND_NS).figures;
    // At 19 ns itself, something may have been lost.
    assert_eq!((figures.from_ns, figures.events), (20, 5));
}

#[test]
fn breaches_after_the_gap_are_found() {
    let twice = with(REST, &[("30 finish c0 0.0.1", "30 finish c1 0.0.1")]);
    assert_shows(
        &lossy(&twice),
        "at 30 ns, one life: subtask `b` of dag `chain` job 0 finishes on core 1 although it runs \
         on core 0",
    );
}
