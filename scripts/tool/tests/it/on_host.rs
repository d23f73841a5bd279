//! DAG files in virtual time, by `run --on host`: what is told of one set, the table of many, and
//! what is refused.

use std::fs;

use crate::support::{assert_refused, call, folder, succeed};
use tool::system::workspace;
use views::protocol::Transcript;

/// Every job of 190 ms is unfinished at its deadline, and cut there (R4).
const LATE: &str = "dag cam period 100ms overrun abort in-flight 1\nsubtask grab wcet 10ms\n\
    subtask detect wcet 90ms\nsubtask track wcet 90ms\nedge grab -> detect\nedge grab -> track\n";

#[test]
fn a_set_is_bounded_run_judged_and_kept_as_by_the_machine() {
    let folder = folder("on-host");
    let demo = workspace().join("apps/dag-file/examples/demo.dag");
    let run = format!(
        "run --on host --jobs 20 --keep run.rec --dag {}",
        demo.display()
    );
    let said = succeed(&folder, &format!("{run} --append overheads_ns=0,0,0"));
    let transcript = Transcript::read(&said);
    assert!(transcript.faults.is_empty(), "{:?}", transcript.faults);
    let of_dag = |line: &views::protocol::MachineLine| {
        let longest = line.number_at("response_time_ns.max");
        [
            longest,
            line.number_at("bound_ns"),
            line.number_at("completed"),
        ]
    };
    let dags: Vec<_> = transcript.of_kind("dag_run").map(of_dag).collect();
    let expected = [[13_000_000, 13_000_000, 20], [500_000, 500_000, 20]];
    assert_eq!(dags, expected.map(|row| row.map(Some)), "{said}");
    // Each bound of the commit is one of a test's.
    let tests: Vec<_> = transcript.of_kind("test_bound").collect();
    for line in transcript.of_kind("dag_run") {
        let names = ["dag", "test"];
        let is_it = |of: &&views::protocol::MachineLine| {
            names
                .iter()
                .all(|name| of.text_at(name) == line.text_at(name))
        };
        let own = tests.iter().copied().find(is_it).expect("it is told");
        assert_eq!(own.number_at("bound_ns"), line.number_at("bound_ns"));
    }
    let judged = succeed(&folder, "check-trace --bound-us 0 run.rec");
    let checks = Transcript::read(&judged);
    let breaches = checks
        .of_kind("trace_check")
        .map(|line| line.number_at("breaches"));
    assert_eq!(breaches.collect::<Vec<_>>(), [Some(0)], "{judged}");
    assert!(judged.contains("  certified: "), "{judged}");
    succeed(&folder, "trace run.rec --svg -o run.svg");
    let svg = fs::read_to_string(folder.join("run.svg")).expect("it is drawn");
    assert!(svg.starts_with("<svg"), "{svg:.80}");
}

#[test]
fn a_late_set_fails_where_deadlines_are_strict() {
    let folder = folder("late");
    fs::write(folder.join("late.dag"), format!("{LATE}end\n")).expect("a file");
    let run = "run --on host --dag late.dag --cores 1 --jobs 20";
    let transcript = Transcript::read(&succeed(&folder, run));
    let misses = transcript
        .of_kind("dag_run")
        .map(|line| line.number_at("deadline_misses"));
    assert_eq!(misses.collect::<Vec<_>>(), [Some(20)]);
    let strict = call(&folder, format!("{run} --strict-deadlines").split(' '));
    assert_eq!(strict.code, Some(1), "{}", strict.complaint);
    let told = "failed: dag `cam` missed 20 deadlines, and none may be missed";
    assert!(strict.complaint.contains(told), "{}", strict.complaint);
}

#[test]
fn a_response_beyond_its_bound_is_a_failure() {
    let folder = folder("beyond");
    fs::write(
        folder.join("late.dag"),
        format!("{LATE}end\n").replace("0ms", "ms"),
    )
    .expect("a file");
    let run = "run --on host --dag late.dag";
    let shorter = "--execution uniform:0.1..0.2 --keep shorter.rec";
    succeed(&folder, &format!("{run} {shorter}"));
    succeed(&folder, "recording shorter.rec --observe small.wcets");
    let called = call(&folder, format!("{run} --wcets small.wcets").split(' '));
    assert_eq!(called.code, Some(1), "{}", called.complaint);
    let told = "dag `cam` took 10.000 ms in job 49, beyond its proven bound of ";
    assert!(called.complaint.contains(told), "{}", called.complaint);
}

/// The columns `file`, `set`, `verdict`, `dag`, `bound_ns`, `completed`, `deadline_misses`,
/// `response_time_ns.max` and `violations` of a row.
const COLUMNS: [usize; 9] = [0, 1, 2, 3, 7, 11, 12, 16, 18];

#[test]
fn many_sets_are_a_table_with_a_row_for_each_dag_and_for_each_refusal() {
    let folder = folder("table");
    let dag = |name: &str, ms: u32| format!("dag {name} period 10ms\nsubtask a wcet {ms}ms\n");
    let sets = format!(
        "set one\n{}{}set two\n{}end\n",
        dag("x", 1),
        dag("y", 2),
        dag("x", 11)
    );
    fs::write(folder.join("b.dag"), &sets).expect("a file");
    fs::write(
        folder.join("a.dag"),
        format!("{}edge a -> q\nend\n", dag("z", 1)),
    )
    .expect("a file");
    let words = "--on host --cores 2 --jobs 3 --append overheads_ns=0,0,0 --dag";
    let called = call(&folder, format!("run {words} .").split(' '));
    assert_eq!(called.code, Some(2), "{}", called.complaint);
    let rows = called
        .out
        .lines()
        .map(|row| row.split(',').collect::<Vec<_>>());
    let shown = rows
        .clone()
        .map(|row| COLUMNS.map(|column| row[column]).join(" "));
    let expected = "\
file set verdict dag bound_ns completed deadline_misses response_time_ns.max violations
./a.dag  refused      
./b.dag one ok x 1000000 3 0 1000000 0
./b.dag one ok y 2000000 3 0 2000000 0
./b.dag two refused      ";
    assert_eq!(shown.collect::<Vec<_>>().join("\n"), expected);
    // Each reason has the line of the person's file.
    for why in [
        "a.dag:3: no subtask `q` stands before",
        "b.dag:8: subtask `a` of dag `x` has a WCET of 11ms",
    ] {
        assert!(called.out.contains(why), "{}", called.out);
    }
    let told = "3 sets: 1 proven, 2 refused, 0 failed";
    assert!(called.complaint.contains(told), "{}", called.complaint);
    // The same file alone is a table, too.
    let alone = call(&folder, format!("run {words} b.dag").split(' ')).out;
    assert_eq!(alone.lines().count(), called.out.lines().count() - 1);
}

#[test]
fn a_set_without_an_end_has_a_row_and_keeps_no_other_from_being_run() {
    let folder = folder("endless");
    let set =
        |jobs: &str| format!("set of{jobs}\ndag x period 1ms jobs {jobs}\nsubtask a wcet 1us\n");
    let sets = ["3", "1000000000", "2"].map(set).concat();
    fs::write(folder.join("sets.dag"), sets + "end\n").expect("a file");
    let run = "run --on host --timeout 1 --dag sets.dag";
    let called = call(&folder, run.split(' '));
    assert_eq!(called.code, Some(1), "{}", called.complaint);
    let rows = called.out.lines().skip(1);
    let begins = rows.map(|row| row.split(',').take(4).collect::<Vec<_>>().join(" "));
    let expected = [
        "sets.dag of3 ok x",
        "sets.dag of1000000000 failed ",
        "sets.dag of2 ok x",
    ];
    assert_eq!(begins.collect::<Vec<_>>(), expected, "{}", called.out);
    assert!(called.out.contains("\"no end within "), "{}", called.out);
    let told = "3 sets: 2 proven, 0 refused, 1 failed";
    assert!(called.complaint.contains(told), "{}", called.complaint);
}

#[test]
fn a_workflow_of_a_thousand_tasks_is_bounded() {
    let folder = folder("workflow");
    // As Montage's: projections, their differences, a model of all, corrections, a sum.
    let wide = |name: &str, count: u32| (0..count).map(move |n| format!("{name}{n}")).collect();
    let [project, diff, correct]: [Vec<String>; 3] =
        [("project", 250), ("diff", 502), ("correct", 250)].map(|(name, count)| wide(name, count));
    let all = project.iter().chain(&diff).chain(&correct);
    let mut text =
        String::from("dag montage period 3600s\nsubtask model wcet 9s\nsubtask add wcet 9s\n");
    all.for_each(|name| text += &format!("subtask {name} wcet 1s\n"));
    for (number, diff) in diff.iter().enumerate() {
        let [one, other] = [number, number + 1 + number / 250].map(|it| &project[it % 250]);
        text += &format!("edge {one} -> {diff}\nedge {other} -> {diff}\nedge {diff} -> model\n");
    }
    for (project, correct) in project.iter().zip(&correct) {
        text += &format!("edge {project} -> {correct}\n");
        text += &format!("edge model -> {correct}\nedge {correct} -> add\n");
    }
    fs::write(folder.join("montage.dag"), text + "end\n").expect("a file");
    let said = succeed(
        &folder,
        "run --on host --policy edf --jobs 1 --dag montage.dag",
    );
    let transcript = Transcript::read(&said);
    let line = transcript.of_kind("dag_run").next().expect("it is run");
    let number = |name| line.number_at(name).expect(&said);
    assert_eq!(number("subtasks"), 1004);
    // On 8 cores: (250 + 502) / 8 + 9 + 32 + 9 seconds.
    let longest_ns = number("response_time_ns.max");
    assert_eq!(longest_ns, 144_000_000_000);
    assert!(number("bound_ns") >= longest_ns, "{said}");
}

#[test]
fn what_virtual_time_has_no_use_for_is_refused() {
    let folder = folder("refused");
    fs::write(folder.join("late.dag"), format!("{LATE}end\n")).expect("a file");
    let sets = format!("set a\n{LATE}set b\n{LATE}end\n");
    fs::write(folder.join("sets.dag"), sets).expect("a file");
    let run = "run --on host --dag late.dag";
    let rows = format!(
        "\
run --on host | `--on host` runs DAGs of a file; name one by `--dag FILE`
{run} --gdb | `--gdb` is for the bare machine; leave it or `--on host` out
{run} --mode kvm | `--mode` is not for virtual time; leave it or `--on host` out
{run} --page | `--page` is not for virtual time; leave it or `--on host` out
run --on host --dag sets.dag --keep x.rec | `--keep` is for one set; name a file of one with `--dag`"
    );
    assert_refused(&folder, &rows);
    // Words for the commit are refused by it, as on the machine.
    for (words, why) in [
        (
            "clusters=9",
            "late.dag:1: the clusters have 9 cores, and the machine has 8; give",
        ),
        (
            "jbos=3",
            "command line: `jbos` is no option; there are overheads, ",
        ),
        (
            "idle=halt",
            "command line: `idle` means nothing here; leave it out",
        ),
        (
            "grid_us=5",
            "a grid or a window of time is for the machine; there is none",
        ),
        (
            "window_us=5",
            "a grid or a window of time is for the machine; there is none",
        ),
    ] {
        let called = call(&folder, format!("{run} --append {words}").split(' '));
        let said = called.complaint;
        assert_eq!(called.code, Some(2), "{said}");
        assert!(said.contains(why), "{said}");
    }
}
