//! Traces whose oldest events were overwritten.

use super::*;

const HEADER: &str = r#"
{"kind":"trace_begin","policy":"static","preemption":"on","cores":2,"run":0}
{"kind":"trace_dag","dag":0,"name":"chain","period_ns":100,"relative_deadline_ns":100,"offset_ns":0,"in_flight":1,"overrun":"queue","subtasks":[["a",0,0,null],["b",1,0,null]],"edges":[[0,1]]}"#;

/// Core 1 has lost how `a` was started.
const REST: &str = "
0 released c0 0.0
0 ready c0 0.0.0
20 finish c1 0.0.0
20 ready c1 0.0.1
21 start c0 0.0.1
30 finish c0 0.0.1
30 completed c0 0.0
";

fn lossy(events: &str, lost_by_core: Option<Vec<u64>>) -> Run {
    Run {
        lost: 1,
        lost_by_core,
        ..run_of(HEADER, events)
    }
}

#[test]
fn without_a_loss_the_gap_is_a_breach() {
    let found = breaches(&run_of(HEADER, REST));
    assert_eq!(found.len(), 2, "{found:?}");
}

#[test]
fn judged_is_what_came_after_the_gap() {
    let run = lossy(REST, None);
    assert_eq!(breaches(&run), [""; 0]);
    let figures = check(&run, BOUND_NS).figures;
    // At 20 ns itself, core 1 may have lost something.
    assert_eq!((figures.from_ns, figures.events), (21, 3));
}

#[test]
fn only_a_core_that_has_lost_something_moves_the_beginning() {
    let events = with(REST, &[("20 finish c1", "10 start c1 0.0.0\n20 finish c1")]);
    let run = lossy(&events, Some(vec![1, 0]));
    let figures = check(&run, BOUND_NS).figures;
    assert_eq!((figures.from_ns, figures.events), (1, 6));
    assert_eq!(breaches(&run), [""; 0]);
}

#[test]
fn breaches_after_the_gap_are_found() {
    let twice = with(REST, &[("30 finish c0 0.0.1", "30 finish c1 0.0.1")]);
    assert_shows(
        &lossy(&twice, None),
        "at 30 ns, one life: subtask `b` of dag `chain` job 0 finishes on core 1 although it runs \
         on core 0",
    );
}
