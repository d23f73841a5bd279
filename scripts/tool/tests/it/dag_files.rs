//! `run --dag` with a file that is wrong: refused before anything boots, as FILE:LINE, offender
//! and remedy.

use std::fs;

use crate::support::{assert_refused, call, folder, refusal, succeed};

const DAG: &str = "dag x period 10ms\nsubtask a wcet 1ms\nsubtask b wcet 1ms\nedge a -> b\nend\n";
/// A file's name, a part of the good file, its replacement, and the refusal. A line's end is `/`, and
/// `..` is the rest of the file. `by_convert.rs` has those of other formats.
const WRONG: &str = r#"
cycle.dag | end | edge b -> a/end | cycle.dag:5: dag `x` has a cycle: subtask `a` -> subtask `b` -> subtask `a`; remove one
late.dag | 10ms | 500000000s offset 18000000000s | late.dag:1: the deadline of the first job of dag `x`
graph.txt | dag.. | nodes:/ | (read as our format; others end in .yaml, .yml, .json
"#;

#[test]
fn a_broken_file_is_named_with_its_line() {
    let folder = folder("broken");
    for row in WRONG.lines().skip(1) {
        let row = row.replace('/', "\n");
        let [name, from, to, words] = row.split(" | ").collect::<Vec<_>>()[..] else {
            panic!("{row}");
        };
        let good = DAG;
        let text = match from.strip_suffix("..") {
            Some(from) => good.split_once(from).expect(from).0.to_string() + to,
            None => good.replacen(from, to, 1),
        };
        assert_ne!(text, good, "{row}");
        let path = folder.join(name);
        fs::write(&path, text).expect("the test's folder takes a file");
        let path = path.to_str().expect("UTF-8");
        let said = refusal(&folder, ["run", "--dag", path]);
        assert!(said.starts_with(&format!("run: {path}:")), "{said}");
        assert!(said.contains(words), "{said}\nnot: {words}");
    }
}

#[test]
fn what_is_repeated_of_a_file_can_be_seen_and_of_many_faults_a_part_is_told() {
    let folder = folder("escape");
    fs::write(folder.join("escape.dag"), "\u{1b}[2J\u{202e}\n").expect("a file");
    let rows = r"run --dag escape.dag | escape.dag:1: expected `set`, `dag`, `subtask`, `edge`, `core`, `certificate`, `state` or `end`, found `\u{1b}[2J\u{202e}`";
    assert_refused(&folder, rows);
    let subtask = |number: u32| format!("subtask s{number} wcet 2s\n");
    let subtasks: String = (0..1000).map(subtask).collect();
    let text = format!("dag x period 1s\n{subtasks}end\n");
    fs::write(folder.join("faults.dag"), text).expect("a file");
    let refused = call(&folder, ["run", "--dag", "faults.dag"]);
    let said = refused.complaint;
    assert_eq!(
        (refused.code, said.lines().count()),
        (Some(2), 21),
        "{said}"
    );
    let rest = "faults.dag:22: and 980 more faults from this line on\n";
    assert!(said.ends_with(rest), "{said}");
}

#[test]
fn options_that_do_not_fit_are_2() {
    let folder = folder("options");
    fs::write(folder.join("good.dag"), DAG).expect("a file");
    fs::create_dir(folder.join("set")).expect("a folder");
    fs::copy(folder.join("good.dag"), folder.join("set/good.dag")).expect("a file");
    let rows = "
run --dag good.dag --app drone | `--app` and `--dag` exclude each other
run --dag good.dag --jobs 1 --seconds 1 | `--jobs` and `--seconds` exclude
run --dag good.dag --jobs 0 | `--jobs 0` has no end, which is for fork-join; with `--dag` give at least 1
run --dag good.dag --execution most | `--execution`: `most`: give wcet, uniform:
run --dag good.dag --unit 1 | `--unit`: `1` has no unit
run --dag good.dag --graph g | `--graph g` is for a set of task graphs
run --dag set --trace run.rec | run: `--trace` is for one file; name one with `--dag`
run --dag set --console | run: `--console` is for one file; name one with `--dag`
run --dag set --print-dag | run: `--print-dag` is for one file; name one with `--dag`";
    assert_refused(&folder, rows);
}

#[test]
fn ten_thousand_subtasks_are_read_and_more_than_any_guest_holds_are_2() {
    let folder = folder("many");
    let many = |subtasks: usize| {
        let lines = (0..subtasks).map(|number| format!("subtask s{number} wcet 1us\n"));
        let text = format!("dag many period 1s\n{}end\n", lines.collect::<String>());
        fs::write(folder.join("many.dag"), text).expect("a file");
    };
    many(10_000);
    let printed = succeed(&folder, "run --print-dag --dag many.dag");
    assert_eq!(printed.matches("\nsubtask ").count(), 10_000);
    many(20_000);
    let said = refusal(&folder, ["run", "--dag", "many.dag"]);
    let words = "its 20000 subtasks, their jobs and the file itself need 5";
    assert!(
        said.starts_with(&format!("run: many.dag: {words}")),
        "{said}"
    );
}
