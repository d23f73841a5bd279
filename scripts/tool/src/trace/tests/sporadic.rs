//! R1 and R4 of a sporadic DAG: its distance, and deadlines without a grid.

use super::*;

/// One subtask on one core, T = 100, D = 20, O = 0; jobs due at 7 and 107.
const HEADER: &str = r#"
{"kind":"trace_begin","policy":"edf","preemption":"on","cores":1,"run":0}
{"kind":"trace_dag","dag":0,"name":"brake","period_ns":100,"relative_deadline_ns":20,"offset_ns":0,"in_flight":2,"overrun":"queue","subtasks":[["a",0,0,null]],"edges":[],"sporadic":true}"#;

const GOOD: &str = "
7 signalled c0 0.0
7 due c0 0.0
7 released c0 0.0
7 ready c0 0.0.0
8 start c0 0.0.0
12 finish c0 0.0.0
13 completed c0 0.0
30 signalled c0 0.1
40 dropped c0 0.1
107 due c0 0.1
108 released c0 0.1
108 ready c0 0.1.0
109 start c0 0.1.0
120 finish c0 0.1.0
121 completed c0 0.1
";

#[test]
fn a_good_trace_shows_nothing() {
    assert_eq!(breaches(&run_of(HEADER, GOOD)), [""; 0]);
}

#[test]
fn a_release_that_was_never_due() {
    let run = run_of(HEADER, &with(GOOD, &[("107 due c0 0.1\n", "")]));
    let text = "at 108 ns, R1 release: dag `brake` job 1 is released, and nothing says when it \
                was due";
    assert_shows(&run, text);
}

#[test]
fn jobs_that_are_due_too_close() {
    let run = run_of(HEADER, &with(GOOD, &[("107 due", "106 due")]));
    let text = "at 106 ns, R1 release: dag `brake` job 1 is due before 107 ns, the earliest by its \
                DAG's distance";
    assert_shows(&run, text);
}

#[test]
fn a_start_before_its_release() {
    let events = with(
        GOOD,
        &[(
            "108 released c0 0.1\n108 ready c0 0.1.0\n109 start",
            "105 released c0 0.1\n105 ready c0 0.1.0\n106 start",
        )],
    );
    let run = run_of(HEADER, &events);
    let text =
        "at 105 ns, R1 release: dag `brake` job 1 is released before its release time 107 ns";
    assert_shows(&run, text);
}

#[test]
fn a_miss_that_nobody_noticed() {
    let events = with(
        GOOD,
        &[
            ("120 finish", "130 finish"),
            ("121 completed", "131 completed"),
        ],
    );
    let run = run_of(HEADER, &events);
    let text = "at 130 ns, R4 completion: dag `brake` job 1 is not missed although its last \
                instance finished at 130 ns, after its deadline 127 ns";
    assert_shows(&run, text);
}
