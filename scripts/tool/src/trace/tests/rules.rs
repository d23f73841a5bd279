//! R1 to R4, one life, one core: a good trace, and each breach of it.

use super::*;

/// One DAG on two cores: `a` precedes `b` and `c`, which precede `d`; T = 100,
/// D = 90, O = 10.
const HEADER: &str = r#"
{"kind":"trace_begin","policy":"static","preemption":"on","cores":2,"run":0}
{"kind":"trace_dag","dag":0,"name":"fork","period_ns":100,"relative_deadline_ns":90,"offset_ns":10,"in_flight":2,"overrun":"queue","subtasks":[["a",0,0,null],["b",1,0,null],["c",2,0,10],["d",3,0,null]],"edges":[[0,1],[0,2],[1,3],[2,3]]}"#;

/// Two jobs; the second one misses its deadline.
const GOOD: &str = "
10 released c0 0.0
10 ready c0 0.0.0
11 start c0 0.0.0
20 finish c0 0.0.0
21 ready c0 0.0.1
22 ready c0 0.0.2
23 start c0 0.0.1
24 start c1 0.0.2
40 finish c0 0.0.1
50 finish c1 0.0.2
51 ready c1 0.0.3
52 start c1 0.0.3
60 finish c1 0.0.3
61 completed c1 0.0
110 released c0 0.1
110 ready c0 0.1.0
111 start c0 0.1.0
120 finish c0 0.1.0
121 ready c0 0.1.1
121 ready c0 0.1.2
123 start c0 0.1.1
124 start c1 0.1.2
140 finish c1 0.1.2
150 finish c0 0.1.1
151 ready c0 0.1.3
152 start c0 0.1.3
201 missed c0 0.1
230 finish c0 0.1.3
231 completed c0 0.1
";

fn good() -> Run {
    run_of(HEADER, GOOD)
}

fn changed(changes: &[(&str, &str)]) -> Run {
    run_of(HEADER, &with(GOOD, changes))
}

#[test]
fn a_good_trace_shows_nothing_but_its_figures() {
    let mut run = good();
    run.complete = true;
    assert_eq!(breaches(&run), [""; 0]);
    let figures = check(&run, BOUND_NS).figures;
    assert_eq!(figures.instances, 8);
    assert_eq!(figures.finish_to_ready_max_ns, 2);
    // Ready to start, a core idle: 1 2 2 1 1 2 3 1.
    assert_eq!(figures.ready_to_start.count, 8);
    assert_eq!(figures.ready_to_start.median_ns, 1);
    assert_eq!(figures.ready_to_start.max_ns, 3);
    assert_eq!(figures.longest_inversion_ns, 3);
    assert_eq!(figures.span_ns, 221);
    // Core 0: 9 + 17 + 9 + 27 + 78; core 1: 26 + 8 + 16.
    assert_eq!(figures.load_permille, [140_000 / 221, 50_000 / 221]);
}

#[test]
fn r1_a_release_before_its_nominal_time() {
    assert_shows(
        &changed(&[("110 released c0 0.1", "109 released c0 0.1")]),
        "at 109 ns, R1 release: dag `fork` job 1 is released before its release time 110 ns",
    );
}

#[test]
fn r1_an_instance_before_its_release() {
    assert_shows(
        &changed(&[("110 ready c0 0.1.0", "109 ready c0 0.1.0")]),
        "at 109 ns, R1 release: subtask `a` of dag `fork` job 1 is ready on core 0 before its \
         release time 110 ns",
    );
    assert_shows(
        &changed(&[("110 released c0 0.1", "112 released c0 0.1")]),
        "at 110 ns, R1 release: subtask `a` of dag `fork` job 1 is ready on core 0 before its \
         release was made at 112 ns",
    );
    assert_shows(
        &changed(&[("110 released c0 0.1\n", "")]),
        "at 110 ns, R1 release: subtask `a` of dag `fork` job 1 is ready on core 0 although its \
         job was never released",
    );
}

#[test]
fn r1_a_job_released_and_skipped_or_released_twice() {
    let skipped = "110 released c0 0.1\n110 skipped c0 0.1";
    assert_shows(
        &changed(&[("110 released c0 0.1", skipped)]),
        "at 110 ns, R1 release: dag `fork` job 1 is skipped although it was released at 110 ns",
    );
    let twice = "110 released c0 0.1\n110 released c0 0.1";
    assert_shows(
        &changed(&[("110 released c0 0.1", twice)]),
        "at 110 ns, R1 release: dag `fork` job 1 is released although it was released at 110 ns",
    );
}

#[test]
fn r2_ready_or_started_before_a_predecessor_finished() {
    assert_shows(
        &changed(&[("51 ready c1 0.0.3", "49 ready c1 0.0.3")]),
        "at 49 ns, R2 join: subtask `d` of dag `fork` job 0 is ready on core 1; subtask `c` of \
         dag `fork` job 0, which it waits for, finishes only at 50 ns on core 1",
    );
    assert_shows(
        &changed(&[("24 start c1 0.0.2", "19 start c1 0.0.2")]),
        "at 19 ns, R2 join: subtask `c` of dag `fork` job 0 starts on core 1; subtask `a` of dag \
         `fork` job 0, which it waits for, finishes only at 20 ns on core 0",
    );
    assert_shows(
        &changed(&[("40 finish c0 0.0.1\n", "")]),
        "at 51 ns, R2 join: subtask `d` of dag `fork` job 0 is ready on core 1; subtask `b` of dag \
         `fork` job 0, which it waits for, finishes later or never",
    );
}

#[test]
fn r2_two_instances_of_one_subtask_at_a_time() {
    assert_shows(
        &changed(&[("60 finish c1 0.0.3", "160 finish c1 0.0.3")]),
        "at 151 ns, R2 join: subtask `d` of dag `fork` job 1 is ready on core 0; subtask `d` of \
         dag `fork` job 0, the job before, is over only at 160 ns on core 1",
    );
}

#[test]
fn r3_a_successor_released_in_another_step() {
    // Not with `b`, but when core 0 has started that.
    assert_shows(
        &changed(&[
            ("22 ready c0 0.0.2\n", ""),
            ("23 start c0 0.0.1", "22 start c0 0.0.1\n23 ready c0 0.0.2"),
        ]),
        "at 23 ns, R3 completion boundary: subtask `c` of dag `fork` job 0 is ready in a step on \
         core 0 that nothing it waits for brought about; the last of that was over at 20 ns on \
         core 0",
    );
}

#[test]
fn r3_a_successor_released_late() {
    assert_shows(
        &changed(&[
            ("51 ready c1 0.0.3", "56 ready c1 0.0.3"),
            ("52 start c1 0.0.3", "56 start c1 0.0.3"),
        ]),
        "at 56 ns, R3 completion boundary: subtask `d` of dag `fork` job 0 is ready 6 ns after the \
         last of what it waits for was over at 50 ns",
    );
}

#[test]
fn r3_a_successor_that_is_forgotten() {
    let run = changed(&[("22 ready c0 0.0.2\n", ""), ("24 start c1 0.0.2\n", "")]);
    let run = Run {
        events: run
            .events
            .into_iter()
            .filter(|event| event.subtask != Some(SubtaskId(2)) || event.job > 0)
            .collect(),
        ..run
    };
    assert_shows(
        &run,
        "at 20 ns, R3 completion boundary: subtask `c` of dag `fork` job 0 is never ready although \
         all that it waits for was over at 20 ns on core 0",
    );
}

#[test]
fn r3_two_finishes_may_take_the_lock_in_the_other_order() {
    // `b` finishes at 49 and takes the lock after `c`, which finished at 50.
    let run = changed(&[
        ("40 finish c0 0.0.1", "49 finish c0 0.0.1"),
        ("51 ready c1 0.0.3", "51 ready c0 0.0.3"),
    ]);
    assert_eq!(breaches(&run), [""; 0]);
}

#[test]
fn r4_completed_before_or_apart_from_the_last_finish() {
    assert_shows(
        &changed(&[("61 completed c1 0.0", "59 completed c1 0.0")]),
        "at 59 ns, R4 completion: dag `fork` job 0 is completed although subtask `d` of dag `fork` \
         job 0 is over only at 60 ns",
    );
    assert_shows(
        &changed(&[
            ("61 completed c1 0.0\n", ""),
            (
                "111 start c0 0.1.0",
                "111 start c0 0.1.0\n111 completed c0 0.0",
            ),
        ]),
        "at 111 ns, R4 completion: dag `fork` job 0 is completed in a step on core 0 that no \
         instance of it brought about; the last of that was over at 60 ns on core 1",
    );
    assert_shows(
        &changed(&[("61 completed c1 0.0", "70 completed c1 0.0")]),
        "at 70 ns, R4 completion: dag `fork` job 0 is completed 10 ns after all of it was over at \
         60 ns",
    );
    assert_shows(
        &changed(&[("61 completed c1 0.0\n", "")]),
        "at 60 ns, R4 completion: dag `fork` job 0 is not completed although all of it was over \
         at 60 ns",
    );
}

#[test]
fn r4_a_miss_that_was_none_and_one_that_was_not_noticed() {
    assert_shows(
        &changed(&[("201 missed c0 0.1\n", "")]),
        "at 230 ns, R4 completion: dag `fork` job 1 is not missed although its last instance \
         finished at 230 ns, after its deadline 200 ns",
    );
    assert_shows(
        &changed(&[("201 missed c0 0.1", "200 missed c0 0.1")]),
        "at 200 ns, R4 completion: dag `fork` job 1 is missed before its deadline 200 ns has \
         passed",
    );
    let missed = "61 completed c1 0.0\n101 missed c1 0.0";
    assert_shows(
        &changed(&[("61 completed c1 0.0", missed)]),
        "at 101 ns, R4 completion: dag `fork` job 0 is missed although its last instance finished \
         at 60 ns, by its deadline 100 ns",
    );
}

#[test]
fn r4_a_finish_in_time_may_cross_with_the_notice_of_the_miss() {
    let run = changed(&[
        ("201 missed c0 0.1", "204 missed c1 0.1"),
        ("230 finish c0 0.1.3", "200 finish c0 0.1.3"),
        ("231 completed c0 0.1", "205 completed c0 0.1"),
    ]);
    assert_eq!(breaches(&run), [""; 0]);
}

#[test]
fn r4_an_unfinished_job_counts_only_if_the_run_says_that_it_is_complete() {
    let cut = GOOD.split("230 finish").next().unwrap();
    let mut run = run_of(HEADER, cut);
    assert_eq!(breaches(&run), [""; 0]);
    run.complete = true;
    assert_shows(
        &run,
        "at 201 ns, R4 completion: dag `fork` job 1 is not completed although the run says that \
         it is",
    );
}

#[test]
fn one_life_started_or_finished_twice_or_out_of_turn() {
    let name = "subtask `d` of dag `fork` job 0";
    for (from, to, breach) in [
        (
            "52 start c1 0.0.3",
            "52 start c1 0.0.3\n53 start c1 0.0.3",
            "at 53 ns, one life: NAME starts on core 1 although it runs on core 1",
        ),
        (
            "60 finish c1 0.0.3",
            "60 finish c1 0.0.3\n60 finish c1 0.0.3",
            "at 60 ns, one life: NAME finishes on core 1 although it is over already",
        ),
        (
            "60 finish c1 0.0.3",
            "60 finish c0 0.0.3",
            "at 60 ns, one life: NAME finishes on core 0 although it runs on core 1",
        ),
        (
            "52 start c1 0.0.3",
            "52 resume c1 0.0.3",
            "at 52 ns, one life: NAME is resumed on core 1 although it is ready and has not started",
        ),
        (
            "60 finish c1 0.0.3",
            "57 suspend c1 0.0.3\n60 finish c1 0.0.3",
            "at 60 ns, one life: NAME finishes on core 1 although it is suspended",
        ),
        (
            "51 ready c1 0.0.3\n",
            "",
            "at 52 ns, one life: NAME starts on core 1 although it never was ready",
        ),
    ] {
        assert_shows(&changed(&[(from, to)]), &breach.replace("NAME", name));
    }
}

#[test]
fn one_core_two_instances_at_a_time() {
    assert_shows(
        &changed(&[
            ("24 start c1 0.0.2", "24 start c0 0.0.2"),
            ("50 finish c1 0.0.2", "50 finish c0 0.0.2"),
        ]),
        "at 24 ns, one core: core 0 runs subtask `c` of dag `fork` job 0 while it still runs \
         subtask `b` of dag `fork` job 0",
    );
}

#[test]
fn a_fault_ends_its_dag_and_nothing_else_is_expected_of_it() {
    let cut = GOOD.split("150 finish").next().unwrap();
    let ended = "150 ended c0 0.1.1\n150 cancelled c0 0.1.3\n150 completed c0 0.1\n";
    let run = run_of(HEADER, &format!("{cut}{ended}"));
    assert_eq!(breaches(&run), [""; 0]);
}
