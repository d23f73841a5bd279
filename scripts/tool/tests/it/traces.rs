//! `check-trace` and `trace`: their output and their exit codes.

use std::fs;
use std::path::PathBuf;

use recording::CommittedTopic;
use views::protocol::{MachineLine, read_line};
use views::record::Record;

use crate::made::{commit, record_of};
use crate::support::{assert_refused, call, folder, succeed};

const EVENTS: &str = "
5 released c0 0.0
6 ready c0 0.0.0
9 start c0 0.0.0
2000000 finish c0 0.0.0
2000001 completed c0 0.0";

/// Returns the record of a run of one job.
pub(crate) fn of_events(events: &str) -> Vec<u8> {
    record_of(
        "",
        &commit("edf 1\nx T=10000000 D=10000000 O=0: a/0"),
        events,
    )
}

pub(crate) fn good() -> Vec<u8> {
    of_events(EVENTS)
}

/// A folder with a good record, and others.
fn traces(name: &str, others: &[(&str, &[u8])]) -> PathBuf {
    let folder = folder(name);
    for (name, bytes) in [("good.rec", &good()[..])].iter().chain(others) {
        fs::write(folder.join(name), bytes).expect("the test's folder takes a file");
    }
    folder
}

/// Returns the machine line of a kind.
pub(crate) fn machine_line(said: &str, kind: &str) -> MachineLine {
    let mut lines = said.lines().filter_map(|line| read_line(1, line));
    let line = lines.find(|line| line.as_ref().is_ok_and(|line| line.kind == kind));
    line.expect(said).expect("it is well formed")
}

#[test]
fn a_good_trace_is_0_and_said_in_a_table_and_a_machine_line() {
    let folder = traces("good", &[]);
    let said = succeed(&folder, "check-trace good.rec");
    assert!(said.contains("breaches                        0"), "{said}");
    let machine = machine_line(&said, "trace_check");
    assert_eq!(machine.number_at("events"), Some(5));
    assert_eq!(machine.text_at("failed_condition"), Some("witness"));
    assert_eq!(machine.number_at("ready_to_start_ns.max"), Some(3));
    // With --json nothing else is on standard output.
    let said = succeed(&folder, "check-trace --json good.rec");
    assert_eq!(said.lines().count(), 1);
}

#[test]
fn a_breach_is_1_and_the_bound_decides() {
    let late = of_events(&EVENTS.replace("9 start", "1500000 start"));
    let folder = traces("late", &[("late.rec", &late)]);
    let called = call(&folder, ["check-trace", "late.rec"]);
    assert_eq!(called.code, Some(1));
    let breach = "  breach at 6 ns, R5 dispatch: subtask `a` of dag `x` job 0 should run and waits \
                  1499994 ns while core 0 is idle";
    let said = called.out;
    assert!(said.lines().any(|line| line == breach), "{said}");
    succeed(&folder, "check-trace --bound-us 1500 late.rec");
}

/// All files are read before the first run is judged. The reader's own tests show the faults of a
/// line.
#[test]
fn a_file_without_a_trace_or_with_a_damaged_one_is_2() {
    let (empty, cut) = (of_events(""), &good()[..100]);
    let strange = of_events(&EVENTS.replace("0.0.0", "0.0.1"));
    let others = [
        ("none.log", &b"hello\nbye\n"[..]),
        ("nothing.log", b""),
        ("empty.rec", &empty),
        ("cut.rec", cut),
        ("strange.rec", &strange),
    ];
    let folder = traces("damaged", &others);
    let rows = "
check-trace good.rec none.log | check-trace: none.log: there is no run in it; `./scripts/run --trace FILE` keeps one
check-trace good.rec nothing.log | check-trace: nothing.log: there is no run in it; `./scripts/run --trace FILE` keeps one
check-trace good.rec empty.rec | check-trace: empty.rec: no run of the file has an event
check-trace good.rec cut.rec | check-trace: cut.rec: there is no run in it; `./scripts/run --trace FILE` keeps one
check-trace good.rec strange.rec | check-trace: strange.rec: events of run 0: Event { time_ns: 6, what: Ready, core: CoreId(0), dag: DagId(0), job: 0, subtask: Some(SubtaskId(1)) } is of nothing that was committed
check-trace | which files?
check-trace none | none: cannot be read
check-trace --bound-us x y | `--bound-us x`: must be a number
trace | which file
trace none | none: cannot be read
trace good.rec -o none/file | `--out none/file`
trace good.rec --run 3 | has no such run; its runs are 0
trace good.rec --svg --from 5 | `--from`: `5` has no unit
trace good.rec --svg --dags X | the run has no dag `X`; there are `x`; did you mean `x`?";
    assert_refused(&folder, rows);
}

/// As a copy of a record that still grows is, or that of a tool that was killed.
#[test]
fn of_a_record_that_is_cut_the_whole_part_is_read_and_a_wrong_one_is_refused() {
    let good = good();
    let dies = |end: &usize| {
        let record = Record::read(&good[..*end]).expect("it only ends too early");
        record.runs.first().is_some_and(|run| !run.complete)
    };
    let end = (100..good.len()).rev().find(dies);
    let end = end.expect("behind the events");
    let mut wrong = good.clone();
    wrong[end / 2] ^= 1;
    let folder = traces("cut", &[("cut.rec", &good[..end]), ("wrong.rec", &wrong)]);
    let said = succeed(&folder, "check-trace cut.rec");
    let ends = "  the record ends before the run: only what came until then is judged\n";
    assert!(said.contains(ends), "{said}");
    for words in ["trace cut.rec", "trace cut.rec --svg"] {
        let drawn = call(&folder, words.split(' '));
        let said = "cut.rec: the record ends before the run\n";
        assert_eq!((drawn.code, drawn.complaint.as_str()), (Some(0), said));
    }
    let shown = succeed(&folder, "recording cut.rec");
    let ends = "incomplete: it says nothing of what came after";
    assert!(shown.contains(ends), "{shown}");
    let rows = "
check-trace wrong.rec | wrong.rec: at byte
trace wrong.rec | wrong.rec: at byte
recording wrong.rec | wrong.rec: at byte";
    assert_refused(&folder, rows);
}

#[test]
fn a_trace_is_drawn_to_a_file_or_to_standard_output() {
    let folder = traces("drawn", &[]);
    let drawn = succeed(&folder, "trace good.rec");
    let value = views::json::parse(&drawn).expect("JSON");
    let events = value.get("traceEvents").expect("events");
    assert!(events.elements().len() > 10, "{drawn}");
    let called = call(&folder, ["trace", "good.rec", "-o", "out.json"]);
    let hint = "out.json: open it at https://ui.perfetto.dev\n";
    assert_eq!((called.code, called.complaint.as_str()), (Some(0), hint));
    let written = fs::read_to_string(folder.join("out.json"));
    assert_eq!(written.expect("written"), drawn);
    let picture = succeed(&folder, "trace good.rec --svg --to 5ms --dags x");
    assert!(picture.starts_with("<svg"), "{picture}");
}

/// `eye`, of period 100, is sampled by `arm`, of period 40. The eye's value of 0 is there at 20;
/// the arm's outputs of 10 find nothing, those of 55, 90 and 132 go back to 0, that of 170 to 100. Of each job: when it is
/// released, starts and finishes, and on which core.
const CHAIN: [(&str, [u64; 3], u32); 7] = [
    ("0.0", [0, 1, 20], 0),
    ("1.0", [0, 1, 10], 1),
    ("1.1", [40, 41, 55], 0),
    ("1.2", [80, 81, 90], 0),
    ("0.1", [100, 101, 125], 0),
    ("1.3", [120, 121, 132], 1),
    ("1.4", [160, 161, 170], 0),
];

/// The record of it, with this bound of the first DAG.
fn chain(bound_ns: u64) -> Vec<u8> {
    let text = format!(
        "edf 2
        eye T=100 D=100 O=0 bound={bound_ns}: look/0
        arm T=40 D=40 O=0 bound=20: move/0"
    );
    let mut commit = commit(&text);
    commit.dags[0].topics = vec![CommittedTopic::default()];
    commit.dags[1].samples = vec![(0, 0, 0, Some(130))];
    let mut events: Vec<(u64, String)> = CHAIN
        .iter()
        .flat_map(|&(job, [at, start, finish], core)| {
            [
                (at, format!("{at} released c0 {job}\n{at} ready c0 {job}.0")),
                (start, format!("{start} start c{core} {job}.0")),
                (finish, format!("{finish} finish c{core} {job}.0")),
                (finish, format!("{finish} completed c{core} {job}")),
            ]
        })
        .collect();
    events.sort_by_key(|event| event.0);
    let events: Vec<String> = events.into_iter().map(|event| event.1).collect();
    record_of("", &commit, &events.join("\n"))
}

#[test]
fn a_chain_across_dags_has_the_times_that_a_person_computes() {
    let records = [("chain.rec", &chain(30)[..]), ("late.rec", &chain(10))];
    let folder = traces("chain", &records);
    let said = succeed(&folder, "check-trace chain.rec");
    // Ages 55, 90, 132 and 70; data ages 90, 132 and 170; the reaction to what is seen just after 0
    // is the output of 170.
    let chain = "
  chain eye/look > arm/move
    age of an output              median 70 ns, p99 132 ns, max 132 ns of 4 (bound 150 ns)
    data age                      median 132 ns, p99 170 ns, max 170 ns of 3 (bound 190 ns)
    reaction time                 median 170 ns, p99 170 ns, max 170 ns of 1 (bound 190 ns)
";
    assert!(said.contains(chain), "{said}");
    let of_chain = "check-trace --json chain.rec --from eye/look --to arm/move";
    let line = machine_line(&succeed(&folder, of_chain), "chain");
    assert_eq!(line.number_at("reaction_ns.max"), Some(170));
    assert_eq!(line.number_at("reaction_bound_ns"), Some(190));
    assert_eq!(line.number_at("exceeded"), Some(0));
    // With 20 less the age of 132 is beyond 130, and nothing else.
    let late = call(&folder, ["check-trace", "--bound-us", "0", "late.rec"]);
    assert_eq!(late.code, Some(1));
    assert!(
        late.out.contains("  breach 1 times of chains are"),
        "{}",
        late.out
    );
    let rows = "
check-trace chain.rec --from eye/lok --to arm/move | did you mean `eye/look`?
check-trace chain.rec --from arm/move --to eye/look | no edges and samples lead from `arm/move`";
    assert_refused(&folder, rows);
}
