//! R1 to R5, one life, one core: good traces, and each breach of them.

use super::*;

/// One DAG on two cores: `a` precedes `b` and `c`, which precede `d`; T = 100,
/// D = 90, O = 10.
const FORK: &str = "
static 2
fork T=100 D=90 O=10 flight=2: a/0 b/1 c/2/10 d/3; 0>1 0>2 1>3 2>3";

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

#[test]
fn a_good_trace_shows_nothing_but_its_figures() {
    assert_each(FORK, GOOD, "complete\n=");
    let figures = check(&run_of(FORK, GOOD), BOUND_NS).figures;
    assert_eq!(figures.instances, 8);
    assert_eq!(figures.finish_to_ready_max_ns, 2);
    // Ready to start, a core idle: 1 2 2 1 1 2 3 1.
    assert_eq!(figures.ready_to_start.count(), 8);
    assert_eq!(figures.ready_to_start.median(), 1);
    assert_eq!(figures.ready_to_start.max(), 3);
    assert_eq!(figures.longest_inversion_ns, 3);
    assert_eq!(figures.span_ns, 221);
    // Core 0: 9 + 17 + 9 + 27 + 78; core 1: 26 + 8 + 16.
    assert_eq!(figures.load_permille, [140_000 / 221, 50_000 / 221]);
}

#[test]
fn r1_nothing_of_a_job_happens_before_its_release_which_is_one() {
    let rows = "
110 released -> 109 released c0 0.1
= at 109 ns, R1 release: dag `fork` job 1 is released before its release time 110 ns
110 ready -> 109 ready c0 0.1.0
= at 109 ns, R1 release: subtask `a` of dag `fork` job 1 is ready on core 0 before its release time 110 ns
110 released -> 112 released c0 0.1
= at 110 ns, R1 release: subtask `a` of dag `fork` job 1 is ready on core 0 before its release was made at 112 ns
110 released ->
= at 110 ns, R1 release: subtask `a` of dag `fork` job 1 is ready on core 0 although its job was never released
110 released -> 110 released c0 0.1; 110 skipped c0 0.1
= at 110 ns, R1 release: dag `fork` job 1 is skipped although it was released at 110 ns
110 released -> 110 released c0 0.1; 110 released c0 0.1
= at 110 ns, R1 release: dag `fork` job 1 is released although it was released at 110 ns";
    assert_each(FORK, GOOD, rows);
}

#[test]
fn r2_an_instance_waits_for_its_predecessors_and_for_the_job_before() {
    let rows = "
51 ready -> 49 ready c1 0.0.3
= at 49 ns, R2 join: subtask `d` of dag `fork` job 0 is ready on core 1; subtask `c` of dag `fork` job 0, which it waits for, finishes only at 50 ns on core 1
24 start -> 19 start c1 0.0.2
= at 19 ns, R2 join: subtask `c` of dag `fork` job 0 starts on core 1; subtask `a` of dag `fork` job 0, which it waits for, finishes only at 20 ns on core 0
40 finish ->
= at 51 ns, R2 join: subtask `d` of dag `fork` job 0 is ready on core 1; subtask `b` of dag `fork` job 0, which it waits for, finishes later or never
60 finish -> 160 finish c1 0.0.3
= at 151 ns, R2 join: subtask `d` of dag `fork` job 1 is ready on core 0; subtask `d` of dag `fork` job 0, the job before, is over only at 160 ns on core 1";
    assert_each(FORK, GOOD, rows);
}

/// The first row: not with `b`, but when core 0 has started it. The last one: `b` finishes at 49
/// and takes the lock after `c`, which finished at 50.
#[test]
fn r3_what_waits_for_a_finish_is_released_in_its_step() {
    let rows = "
22 ready ->
23 start -> 22 start c0 0.0.1; 23 ready c0 0.0.2
= at 23 ns, R3 completion boundary: subtask `c` of dag `fork` job 0 is ready in a step on core 0 that nothing it waits for brought about; the last of that was over at 20 ns on core 0
51 ready -> 56 ready c1 0.0.3
52 start -> 56 start c1 0.0.3
= at 56 ns, R3 completion boundary: subtask `d` of dag `fork` job 0 is ready 6 ns after the last of what it waits for was over at 50 ns
22 ready ->
24 start ->
50 finish ->
= at 20 ns, R3 completion boundary: subtask `c` of dag `fork` job 0 is never ready although all that it waits for was over at 20 ns on core 0
40 finish -> 49 finish c0 0.0.1
51 ready -> 51 ready c0 0.0.3
=";
    assert_each(FORK, GOOD, rows);
}

#[test]
fn r4_a_job_is_completed_with_its_last_finish() {
    let rows = "
61 completed -> 59 completed c1 0.0
= at 59 ns, R4 completion: dag `fork` job 0 is completed although subtask `d` of dag `fork` job 0 is over only at 60 ns
61 completed ->
111 start -> 111 start c0 0.1.0; 111 completed c0 0.0
= at 111 ns, R4 completion: dag `fork` job 0 is completed in a step on core 0 that no instance of it brought about; the last of that was over at 60 ns on core 1
61 completed -> 70 completed c1 0.0
= at 70 ns, R4 completion: dag `fork` job 0 is completed 10 ns after all of it was over at 60 ns
61 completed ->
= at 60 ns, R4 completion: dag `fork` job 0 is not completed although all of it was over at 60 ns
230 finish.. ->
=
complete
230 finish.. ->
= at 201 ns, R4 completion: dag `fork` job 1 is not completed although the run says that it is";
    assert_each(FORK, GOOD, rows);
}

/// The last row: a finish in time may cross with the notice of the miss.
#[test]
fn r4_a_miss_is_noticed_if_there_was_one() {
    let rows = "
201 missed ->
= at 230 ns, R4 completion: dag `fork` job 1 is not missed although its last instance finished at 230 ns, after its deadline 200 ns
201 missed -> 200 missed c0 0.1
= at 200 ns, R4 completion: dag `fork` job 1 is missed before its deadline 200 ns has passed
61 completed -> 61 completed c1 0.0; 101 missed c1 0.0
= at 101 ns, R4 completion: dag `fork` job 0 is missed although its last instance finished at 60 ns, by its deadline 100 ns
201 missed -> 204 missed c1 0.1
230 finish -> 200 finish c0 0.1.3
231 completed -> 205 completed c0 0.1
=";
    assert_each(FORK, GOOD, rows);
}

/// The last row: a fault ends its DAG, and nothing else is expected of it.
#[test]
fn one_life_and_one_core_each_at_a_time() {
    let rows = "
52 start -> 52 start c1 0.0.3; 53 start c1 0.0.3
= at 53 ns, one life: subtask `d` of dag `fork` job 0 starts on core 1 although it runs on core 1
60 finish -> 60 finish c1 0.0.3; 60 finish c1 0.0.3
= at 60 ns, one life: subtask `d` of dag `fork` job 0 finishes on core 1 although it is over already
60 finish -> 60 finish c0 0.0.3
= at 60 ns, one life: subtask `d` of dag `fork` job 0 finishes on core 0 although it runs on core 1
52 start -> 52 resume c1 0.0.3
= at 52 ns, one life: subtask `d` of dag `fork` job 0 is resumed on core 1 although it is ready and has not started
60 finish -> 57 suspend c1 0.0.3; 60 finish c1 0.0.3
= at 60 ns, one life: subtask `d` of dag `fork` job 0 finishes on core 1 although it is suspended
51 ready ->
= at 52 ns, one life: subtask `d` of dag `fork` job 0 starts on core 1 although it never was ready
24 start -> 24 start c0 0.0.2
50 finish -> 50 finish c0 0.0.2
= at 24 ns, one core: core 0 runs subtask `c` of dag `fork` job 0 while it still runs subtask `b` of dag `fork` job 0
150 finish.. -> 150 ended c0 0.1.1; 150 cancelled c0 0.1.3; 150 completed c0 0.1
=";
    assert_each(FORK, GOOD, rows);
}

/// One subtask on one core, T = 100, D = 20, O = 0; jobs due at 7 and 107.
const SPORADIC: &str = "
edf 1
brake sporadic T=100 D=20 O=0 flight=2: a/0";

const SIGNALLED: &str = "
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
fn r1_and_r4_a_sporadic_dag_has_its_distance_and_deadlines_without_a_grid() {
    let rows = "
=
107 due ->
= at 108 ns, R1 release: dag `brake` job 1 is released, and nothing says when it was due
107 due -> 106 due c0 0.1
= at 106 ns, R1 release: dag `brake` job 1 is due before 107 ns, the earliest by its DAG's distance
108 released -> 105 released c0 0.1
108 ready -> 105 ready c0 0.1.0
109 start -> 106 start c0 0.1.0
= at 105 ns, R1 release: dag `brake` job 1 is released before its release time 107 ns
120 finish -> 130 finish c0 0.1.0
121 completed -> 131 completed c0 0.1
= at 130 ns, R4 completion: dag `brake` job 1 is not missed although its last instance finished at 130 ns, after its deadline 127 ns";
    assert_each(SPORADIC, SIGNALLED, rows);
}

/// Two DAGs of one subtask each on one core. `high` goes first.
const TWO: &str = "
static 1
high T=1000 D=300 O=50: h/1
low T=1000 D=900 O=0: l/2";

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

/// The least excess is a breach. The law's own tests show what else R5 forbids and allows.
#[test]
fn r5_the_more_urgent_one_waits_within_the_bound() {
    let rows = "
=
54 suspend -> 56 suspend c0 1.0.0
54 start -> 56 start c0 0.0.0
= at 50 ns, R5 dispatch: subtask `h` of dag `high` job 0 should run and waits 6 ns while core 0 runs subtask `l` of dag `low` job 0";
    assert_each(TWO, PREEMPTED, rows);
    assert_each(&TWO.replace("static", "edf"), PREEMPTED, rows);
    // On two cores, the other one could have taken `low`.
    let idle = "
= at 54 ns, R5 dispatch: subtask `l` of dag `low` job 0 should run and waits 28 ns while core 1 is idle";
    assert_each(&TWO.replace("static 1", "static 2"), PREEMPTED, idle);
}

#[test]
fn a_preemption_is_measured_from_the_latest_request() {
    let figures = |events: &str| check(&run_of(TWO, events), BOUND_NS).figures;
    let measured = figures(PREEMPTED);
    let preemption = &measured.preemption;
    assert_eq!((measured.preemptions, preemption.count()), (1, 1));
    assert_eq!((preemption.max(), measured.longest_inversion_ns), (3, 4));
    // Only `low` found an idle core.
    assert_eq!(measured.ready_to_start.count(), 1);
    let requests = "51 request c0 0.0.0\n52 request c0 1.0.0";
    let overtaken = figures(&PREEMPTED.replace("51 request c0 0.0.0", requests)).preemption;
    // The second one is answered when `low` goes on.
    assert_eq!((overtaken.count(), overtaken.max()), (1, 30));
}

/// `low` waits twice, and `high` runs meanwhile.
const WAITS: &str = "
0 released c0 1.0
0 ready c0 1.0.0
2 start c0 1.0.0
20 wait c0 1.0.0
50 released c0 0.0
50 ready c0 0.0.0
52 start c0 0.0.0
53 wake c0 1.0.0
80 finish c0 0.0.0
80 completed c0 0.0
82 resume c0 1.0.0
99 wait c0 1.0.0
99 wake c0 1.0.0
99 resume c0 1.0.0
120 finish c0 1.0.0
120 completed c0 1.0
";

#[test]
fn w1_an_instance_takes_its_waits_each_within_its_limit() {
    let waits = format!("{TWO}\nwait 1.0 30\nwait 1.0 0");
    let rows = "
=
53 wake -> 55 wake c0 1.0.0
=
53 wake -> 56 wake c0 1.0.0
= at 56 ns, W1 waiting: subtask `l` of dag `low` job 0 ends its wait on core 0, which began at 20 ns and has a limit of 30 ns
53 wake ->
= at 82 ns, one life: subtask `l` of dag `low` job 0 is resumed on core 0 although it waits
99 wait -> 
99 wake -> 
99 resume -> 
= at 120 ns, W1 waiting: subtask `l` of dag `low` job 0 finishes on core 0 after 1 waits, and its subtask states 2
82 resume -> 86 resume c0 1.0.0
= at 80 ns, R5 dispatch: subtask `l` of dag `low` job 0 should run and waits 6 ns while core 0 is idle";
    assert_each(&waits, WAITS, rows);
    let one = format!("{TWO}\nwait 1.0 30");
    let more = "= at 99 ns, W1 waiting: subtask `l` of dag `low` job 0 begins to wait on core 0 after 1 waits, and its subtask states 1";
    assert_each(&one, WAITS, more);
}

const CHAIN: &str = "
static 2
chain T=100 D=100 O=0: a/0 b/1; 0>1";

/// The start of `a` is lost.
const REST: &str = "
19 missed c0 0.7
20 finish c1 0.0.0
20 ready c1 0.0.1
21 start c0 0.0.1
30 finish c0 0.0.1
30 completed c0 0.0
";

/// The oldest events were overwritten. Without a loss, the gap is a breach.
#[test]
fn after_a_loss_what_came_after_the_gap_is_judged() {
    let rows = "
= at 20 ns, R1 release: subtask `a` of dag `chain` job 0 finishes on core 1 although its job was never released
lost
=
lost
30 finish -> 30 finish c1 0.0.1
= at 30 ns, one life: subtask `b` of dag `chain` job 0 finishes on core 1 although it runs on core 0";
    assert_each(CHAIN, REST, rows);
    let run = Run {
        lost: 1,
        ..run_of(CHAIN, REST)
    };
    let figures = check(&run, BOUND_NS).figures;
    // At 19 ns itself, something may have been lost.
    assert_eq!((figures.from_ns, figures.events), (20, 5));
}
