//! A run that is certified, and runs that are not: each differs in one event, or in what else is
//! recorded.

use std::sync::Arc;

use recording::Commit;
use sched_dag::analysis;

use super::certify;
use crate::findings::tests::change;
use crate::findings::{Findings, check};
use crate::made::{commit, event, lines_of, record_of};
use crate::record::{CommittedDags, Record, Run};

/// The longest wait that breaks no rule.
const BOUND_NS: u64 = 20;

const DAGS: &str = "
static 2
fast T=100 D=60 O=0: x/0/20
fork T=400 D=300 O=10: a/1/20 b/1/80 c/1/60 d/1/20; 0>1 0>2 1>3 2>3
order sporadic T=400 D=400 O=0: y/2/15
wait 1.2 30";

/// `c` waits for 20 of 30, and loses its core to `fast`.
const GOOD: &str = "
0 released c0 0.0
0 ready c0 0.0.0
1 start c0 0.0.0
11 released c1 1.0
11 ready c1 1.0.0
12 start c1 1.0.0
19 finish c0 0.0.0
19 completed c0 0.0
30 finish c1 1.0.0
30 ready c1 1.0.1
30 ready c1 1.0.2
31 start c1 1.0.1
32 start c0 1.0.2
50 wait c0 1.0.2
70 wake c0 1.0.2
72 resume c0 1.0.2
100 released c0 0.1
100 ready c0 0.1.0
101 suspend c0 1.0.2
101 start c0 0.1.0
105 finish c1 1.0.1
106 resume c1 1.0.2
116 finish c1 1.0.2
116 ready c1 1.0.3
117 start c1 1.0.3
118 finish c0 0.1.0
118 completed c0 0.1
130 finish c1 1.0.3
130 completed c1 1.0
150 signalled c0 2.0
150 due c0 2.0
150 released c0 2.0
150 ready c0 2.0.0
151 start c0 2.0.0
165 finish c0 2.0.0
180 completed c0 2.0";

/// Returns a run of the DAGs above.
fn run_of(events: &str) -> Run {
    of_commit(commit(DAGS), events)
}

/// Returns a run whose segments are charged 10 each, and whose bounds are proven.
fn of_commit(mut commit: Commit, events: &str) -> Run {
    commit.charge_ns = Some(10);
    let committed = CommittedDags::new(0, commit.clone()).expect("they can be committed");
    let answer = analysis::answer(&committed.task_set, &committed.settings());
    for (dag, bound) in commit.dags.iter_mut().zip(answer.bounds) {
        dag.bound_ns = bound.map(|bound| bound.bound_ns);
    }
    let record = Record::read(&record_of("", &commit, "")).expect("it is well formed");
    Run {
        events: lines_of(events).into_iter().map(event).collect(),
        ..record.runs[0].clone()
    }
}

/// Certifies a run, and says which condition failed.
fn told(run: &Run, findings: &Findings) -> String {
    let failed = |(condition, why)| format!("{condition}: {why}");
    certify(run, findings).map_or_else(failed, |()| "certified".into())
}

fn judged(run: &Run) -> String {
    told(run, &check(run, BOUND_NS))
}

/// The rows are as in the tests of findings; behind `=` stands how the answer begins.
#[test]
fn a_run_is_certified_and_none_that_is_altered_in_one_event() {
    assert_eq!(judged(&run_of(GOOD)), "certified");
    let rows = "
100 released -> 99 released c0 0.1 = rules: at 99 ns, R1 release: dag `fast` job 1
150 released -> 152 released c0 2.0 = rules: at 150 ns, R1 release: subtask `y` of dag `order` job 0
11 released -> = rules: at 11 ns, R1 release: subtask `a` of dag `fork` job 0
100 released -> 100 released c0 0.1; 100 skipped c0 0.1 = rules: at 100 ns, R1 release
150 due -> = rules: at 150 ns, R1 release: dag `order` job 0
116 ready -> 110 ready c1 1.0.3 = rules: at 110 ns, R2 join: subtask `d` of dag `fork` job 0
105 finish -> = rules: at 106 ns, one core: core 1 runs subtask `c` of dag `fork` job 0
30 ready c1 1.0.2 -> 32 ready c0 1.0.2 = rules: at 32 ns, R3
180 completed -> = rules: at 165 ns, R4 completion: dag `order` job 0
180 completed -> 190 completed c0 2.0 = rules: at 190 ns, R4 completion: dag `order` job 0
130 finish -> 135 finish c1 1.0.3 = rules: at 130 ns, R4 completion: dag `fork` job 0
118 finish -> 118 ended c0 0.1.0; 118 dag_ended c0 0.0 = cut: `ended` of dag `fast` job 1
118 finish -> 118 finish c0 0.1.0; 118 aborted c0 0.1 = cut: `aborted` of dag `fast` job 1
180 completed -> 180 completed c0 2.0; 181 queued c0 0.18446744073709551615 = rules: 
180 completed -> 180 completed c0 2.0; 181 due c0 2.0 = record: dag `order` job 0 is due twice
180 completed -> 180 completed c0 2.0; 300 signalled c0 2.1 = record: dag `fast` job 2 was not released
72 resume -> 95 resume c0 1.0.2 = rules: at 70 ns, R5 dispatch: subtask `c` of dag `fork` job 0
50 wait -> = rules: at 70 ns, one life: subtask `c` of dag `fork` job 0
70 wake -> = rules: at 72 ns, one life: subtask `c` of dag `fork` job 0
101 suspend -> 101 suspend c1 1.0.2 = rules: at 101 ns, one life: subtask `c` of dag `fork` job 0
117 start -> 117 start c0 1.0.3 = rules: at 117 ns, one core: core 0 runs subtask `d`
31 start -> 31 start c1 1.0.1; 32 start c1 1.0.1 = rules: at 32 ns, one life: subtask `b`
165 finish -> 177 finish c0 2.0.0 = WCET: subtask `y` of dag `order` job 0 executed for 26 ns from 151 ns on, more than its WCET and charges of 25 ns
165 finish -> 174 finish c0 2.0.0 = lost: subtask `y` of dag `order` job 0 executed for 23 ns from 151 ns on; with 0 ns late and 2 inversions of 2 ns, more than its WCET and charges of 25 ns
117 start -> 127 start c1 1.0.3 = lost: subtask `x` of dag `fast` job 0 executed for 18 ns from 1 ns on; with 0 ns late and 2 inversions of 11 ns, more
72 resume -> 85 resume c0 1.0.2 = lost: subtask `x` of dag `fast` job 0 executed for 18 ns from 1 ns on; with 0 ns late and 2 inversions of 15 ns, more";
    for row in lines_of(rows) {
        let (alteration, answer) = row.split_once(" = ").expect(row);
        let (from, to) = alteration.split_once(" ->").expect(row);
        let mut lines = lines_of(GOOD);
        change(&mut lines, from, to.trim());
        let said = judged(&run_of(&lines.join("\n")));
        assert!(said.starts_with(answer), "{row}\n{said}");
    }
}

#[test]
fn on_one_core_no_job_of_any_dag_is_cut() {
    let dags = "
static 1
high T=200 D=150 O=0: h/0/30
low T=400 D=400 O=10: l/2 k/2; 0>1";
    let events = "
0 released c0 0.0
0 ready c0 0.0.0
1 start c0 0.0.0
10 released c0 1.0
10 ready c0 1.0.0
30 finish c0 0.0.0
30 completed c0 0.0
31 start c0 1.0.0
50 ended c0 1.0.0
50 dag_ended c0 1.0
50 cancelled c0 1.0.1
50 completed c0 1.0";
    let run = of_commit(commit(dags), events);
    let bounds = run.bounds_ns.iter().map(Option::is_some);
    assert_eq!(bounds.collect::<Vec<_>>(), [true, false]);
    assert_eq!(judged(&run), "cut: `ended` of dag `low` job 0");
    let mut lines = lines_of(events);
    change(&mut lines, "31 start", "");
    change(
        &mut lines,
        "30 finish",
        "11 start c1 1.0.0; 30 finish c0 0.0.0",
    );
    change(&mut lines, "50 ended", "50 ended c1 1.0.0");
    let on_two_cores = commit(&dags.replace("static 1", "static 2"));
    let run = of_commit(on_two_cores, &lines.join("\n"));
    assert_eq!(judged(&run), "certified");
}

/// Nothing is preempted. Rows have the number of cores, the events, and the begin of the answer.
#[test]
fn what_keeps_its_core_begins_in_order() {
    let dags = "
high T=400 D=400 O=90: h/0/10
one T=400 D=400 O=71: l/1/30
two T=400 D=400 O=90: m/2/30";
    let shorts = [
        ("HIGH", "90 released c0 0.0; 90 ready c0 0.0.0"),
        ("TWO", "90 released c0 2.0; 90 ready c0 2.0.0"),
        (
            "BEGIN",
            "71 released c0 1.0; 71 ready c0 1.0.0; 72 start c0 1.0.0",
        ),
        ("ONE", "109 finish c0 1.0.0; 109 completed c0 1.0"),
        (
            "RIGHT",
            "110 start c0 0.0.0; 120 finish c0 0.0.0; 120 completed c0 0.0; 121 start c0 2.0.0; END",
        ),
        (
            "WRONG",
            "110 start c0 2.0.0; 138 finish c0 2.0.0; 138 completed c0 2.0; LAST",
        ),
        (
            "LAST",
            "139 start c0 0.0.0; 149 finish c0 0.0.0; 149 completed c0 0.0",
        ),
        ("END", "150 finish c0 2.0.0; 150 completed c0 2.0"),
    ];
    let rows = "
1: BEGIN; HIGH; TWO; ONE; RIGHT = certified
1: BEGIN; HIGH; TWO; ONE; WRONG = order: subtask `m` of dag `two` job 0 began on core 0 at 110 ns and keeps it, although subtask `h` of dag `high` job 0 was ready
1: BEGIN; TWO; ONE; 109 released c0 0.0; 109 ready c0 0.0.0; WRONG = order: subtask `m` of dag `two` job 0 began on core 0 at 110 ns
1: BEGIN; TWO; ONE; 110 released c0 0.0; 110 ready c0 0.0.0; WRONG = lost: subtask `h` of dag `high` job 0 executed for 10 ns from 139 ns on; with 20 ns late
2: HIGH; TWO; 91 start c1 2.0.0; 92 start c0 0.0.0; 102 finish c0 0.0.0; 102 completed c0 0.0; 121 finish c1 2.0.0; 121 completed c1 2.0 = certified
2: BEGIN; TWO; HIGH; 91 start c1 2.0.0; ONE; 110 start c0 0.0.0; 120 finish c0 0.0.0; 120 completed c0 0.0; 121 finish c1 2.0.0; 121 completed c1 2.0 = order: subtask `m` of dag `two` job 0 began on core 1 at 91 ns";
    for row in lines_of(rows) {
        let (run, answer) = row.split_once(" = ").expect(row);
        let (cores, events) = run.split_once(": ").expect(row);
        let long = |text: String, (short, long): &(&str, &str)| text.replace(short, long);
        let events = shorts
            .iter()
            .fold(events.to_string(), long)
            .replace("; ", "\n");
        let mut commit = commit(&format!("static {cores}{dags}"));
        commit.is_preemptive = false;
        let said = judged(&of_commit(commit, &events));
        assert!(said.starts_with(answer), "{row}\n{said}");
    }
}

#[test]
fn only_a_whole_record_with_its_bounds_is_certified() {
    type Alteration = fn(&mut Run);
    fn commit(run: &mut Run) -> &mut Commit {
        &mut Arc::make_mut(&mut run.commit).told
    }
    let alterations: [(Alteration, &str); 5] = [
        (|run| run.lost = 3, "record: 3 events"),
        (|run| run.complete = false, "record: it ends"),
        (|run| run.bounds_ns.fill(None), "witness: no DAG"),
        (
            |run| commit(run).dags[1].bound_ns = None,
            "witness: the bound of dag `fork`",
        ),
        (
            |run| commit(run).charge_ns = Some(9),
            "witness: the bound of dag `fast`",
        ),
    ];
    for (alter, answer) in alterations {
        let mut run = run_of(GOOD);
        alter(&mut run);
        let said = judged(&run);
        assert!(said.starts_with(answer), "{said}");
    }
}

/// The bounds follow from all other conditions, and are asked, too: here the others are blind.
#[test]
fn a_bound_that_fails_is_told() {
    let blind = check(&run_of(GOOD), BOUND_NS);
    let mut lines = lines_of(GOOD);
    change(&mut lines, "117 start", "317 start c1 1.0.3");
    change(&mut lines, "130 finish", "330 finish c1 1.0.3");
    change(
        &mut lines,
        "150 signalled",
        "150 closed c0 0.0; 150 signalled c0 2.0",
    );
    let said = told(&run_of(&lines.join("\n")), &blind);
    let begin = "bound: subtask `d` of dag `fork` job 0 took 320 ns, beyond ";
    assert!(said.starts_with(begin), "{said}");
}
