//! R5: which instance runs, and for how long another one should have.

use super::*;

/// Two DAGs of one subtask each on one core. `high` goes first.
const HEADER: &str = r#"
{"kind":"trace_begin","policy":"POLICY","preemption":"PREEMPTION","cores":CORES,"run":0}
{"kind":"trace_dag","dag":0,"name":"high","period_ns":1000,"relative_deadline_ns":300,"offset_ns":50,"in_flight":1,"overrun":"queue","subtasks":[["h",1,0,null]],"edges":[]}
{"kind":"trace_dag","dag":1,"name":"low","period_ns":1000,"relative_deadline_ns":900,"offset_ns":0,"in_flight":1,"overrun":"queue","subtasks":[["l",2,KEEPS,null]],"edges":[]}"#;

fn header(policy: &str, preemption: &str, cores: &str, keeps: &str) -> String {
    HEADER
        .replace("POLICY", policy)
        .replace("PREEMPTION", preemption)
        .replace("CORES", cores)
        .replace("KEEPS", keeps)
}

fn preemptive() -> String {
    header("static", "on", "1", "0")
}

/// `high` preempts `low`, three nanoseconds after the request.
const PREEMPTED: &str = "
0 released c0 1.0
0 ready c0 1.0.0
2 start c0 1.0.0
50 released c0 0.0
50 ready c0 0.0.0
51 request c0 0.0.0
54 suspend c0 1.0.0
54 start c0 0.0.0
80 finish c0 0.0.0
81 completed c0 0.0
82 resume c0 1.0.0
99 finish c0 1.0.0
99 completed c0 1.0
";

/// `low` keeps its core, and `high` has to wait.
const KEPT: &str = "
0 released c0 1.0
0 ready c0 1.0.0
2 start c0 1.0.0
50 released c0 0.0
50 ready c0 0.0.0
90 finish c0 1.0.0
91 completed c0 1.0
92 start c0 0.0.0
99 finish c0 0.0.0
99 completed c0 0.0
";

#[test]
fn a_preemption_within_the_bound_is_right_and_measured() {
    for policy in ["static", "edf"] {
        let run = run_of(&header(policy, "on", "1", "0"), PREEMPTED);
        assert_eq!(breaches(&run), [""; 0]);
        let figures = check(&run, BOUND_NS).figures;
        assert_eq!(figures.preemptions, 1);
        assert_eq!(
            (figures.preemption.count, figures.preemption.max_ns),
            (1, 3)
        );
        assert_eq!(figures.longest_inversion_ns, 4);
        // Only `low` found an idle core.
        assert_eq!(figures.ready_to_start.count, 1);
    }
}

#[test]
fn an_inversion_longer_than_the_bound_is_found() {
    let expected = "at 50 ns, R5 dispatch: subtask `h` of dag `high` job 0 should run and waits \
                    42 ns while core 0 runs subtask `l` of dag `low` job 0";
    assert_shows(&run_of(&preemptive(), KEPT), expected);
    let edf = header("edf", "on", "1", "0");
    assert_shows(&run_of(&edf, KEPT), expected);
    // A little too late is too late.
    let late = with(
        PREEMPTED,
        &[
            ("54 suspend c0 1.0.0", "56 suspend c0 1.0.0"),
            ("54 start c0 0.0.0", "56 start c0 0.0.0"),
        ],
    );
    assert_shows(
        &run_of(&preemptive(), &late),
        &expected.replace("42 ns", "6 ns"),
    );
}

#[test]
fn a_started_instance_may_keep_its_core() {
    let without_preemption = header("static", "off", "1", "0");
    assert_eq!(breaches(&run_of(&without_preemption, KEPT)), [""; 0]);
    let non_preemptive = header("static", "on", "1", "1");
    assert_eq!(breaches(&run_of(&non_preemptive, KEPT)), [""; 0]);
}

#[test]
fn the_wrong_one_started_on_a_core_that_it_keeps_is_found() {
    // `low` has finished; its next job starts although `high` waits.
    let second = with(
        KEPT,
        &[(
            "92 start c0 0.0.0\n99 finish c0 0.0.0\n99 completed c0 0.0\n",
            "1000 released c0 1.1\n1000 ready c0 1.1.0\n1001 start c0 1.1.0\n",
        )],
    );
    let run = run_of(&header("static", "off", "1", "0"), &second);
    assert_shows(
        &run,
        "at 1001 ns, R5 dispatch: subtask `l` of dag `low` job 1 starts on core 0 and keeps it, \
         although subtask `h` of dag `high` job 0 waits since 50 ns and goes first",
    );
}

#[test]
fn an_idle_core_is_found() {
    let run = run_of(&header("static", "off", "2", "0"), KEPT);
    assert_shows(
        &run,
        "at 50 ns, R5 dispatch: subtask `h` of dag `high` job 0 should run and waits 42 ns while \
         core 1 is idle",
    );
}

#[test]
fn a_preemption_while_a_core_is_idle_is_found() {
    // The other core could have taken `low`.
    let run = run_of(&header("static", "on", "2", "0"), PREEMPTED);
    assert_shows(
        &run,
        "at 54 ns, R5 dispatch: subtask `l` of dag `low` job 0 should run and waits 28 ns while \
         core 1 is idle",
    );
}

#[test]
fn a_request_that_is_overtaken_is_not_measured() {
    let overtaken = with(
        PREEMPTED,
        &[(
            "51 request c0 0.0.0",
            "51 request c0 0.0.0\n52 request c0 1.0.0",
        )],
    );
    let figures = check(&run_of(&preemptive(), &overtaken), BOUND_NS).figures;
    // The second one is answered when `low` goes on.
    assert_eq!(
        (figures.preemption.count, figures.preemption.max_ns),
        (1, 30)
    );
}
