//! R1 and R4 of a sporadic DAG: its distance, and deadlines without a grid.

use super::*;

/// One subtask on one core, T = 100, D = 20, O = 0; jobs due at 7 and 107.
fn header(releases: &str) -> String {
    format!(
        r#"
{{"kind":"trace_begin","policy":"edf","preemption":"on","cores":1,"run":0}}
{{"kind":"trace_dag","dag":0,"name":"brake","period_ns":100,"relative_deadline_ns":20,"offset_ns":0,"in_flight":2,"overrun":"queue","subtasks":[["a",0,0,null]],"edges":[],"sporadic":true,"releases":{releases}}}"#
    )
}

const GOOD: &str = "
7 signalled c0 0.0
7 released c0 0.0
7 ready c0 0.0.0
8 start c0 0.0.0
12 finish c0 0.0.0
13 completed c0 0.0
30 signalled c0 0.1
40 dropped c0 0.1
108 released c0 0.1
108 ready c0 0.1.0
109 start c0 0.1.0
120 finish c0 0.1.0
121 completed c0 0.1
";

const EXACT: &str = "[[0,7],[1,107]]";

#[test]
fn a_good_trace_shows_nothing() {
    for releases in [EXACT, "[]"] {
        let run = run_of(&header(releases), GOOD);
        assert_eq!(breaches(&run), [""; 0]);
    }
}

#[test]
fn jobs_that_are_due_too_close() {
    let run = run_of(&header("[[0,7],[1,106]]"), GOOD);
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
    let run = run_of(&header(EXACT), &events);
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
    let run = run_of(&header(EXACT), &events);
    let text = "at 130 ns, R4 completion: dag `brake` job 1 is not missed although its last \
                instance finished at 130 ns, after its deadline 127 ns";
    assert_shows(&run, text);
}

#[test]
fn a_release_list_that_is_none() {
    let log = header("[[0]]");
    let fault = read(&log).expect_err("damaged");
    assert!(
        fault.reason.contains("a pair of a job and a time"),
        "{}",
        fault.reason
    );
}
