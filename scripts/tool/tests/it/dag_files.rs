//! `run --dag` with a file that is wrong: refused before anything boots, as FILE:LINE, offender
//! and remedy.

use std::fs;
use std::path::Path;

use tool::system::workspace;

use crate::support::{assert_refused, call, folder, refusal, succeed};

const DAG: &str = "dag x period 10ms\nsubtask a wcet 1ms\nsubtask b wcet 1ms\nedge a -> b\nend\n";
const YAML: &str = "nodes:\n- id: 0\n  execution_time: 5\n  period: 9\n- id: 1\n  \
    execution_time: 2\nlinks:\n- source: 0\n  target: 1\n";
const JSON: &str = "{\"graphs\":[\n{\"name\":\"a\",\"c\":[1,2,4],\"edges\":[[0,1],[1,2]]}]}";

/// A file's name, a part of the good file of its format, its replacement, and the refusal. A line's
/// end is `/`, and `..` is the rest of the file.
const WRONG: &str = r#"
cycle.dag | end | edge b -> a/end | cycle.dag:5: dag `x` has a cycle: subtask `a` -> subtask `b` -> subtask `a`; remove one
cycle.yaml | target: 1 | target: 1/- source: 1/  target: 0 | cycle.yaml:10: dag `cycle` has a cycle
cycle.json | [1,2] | [1,0] | cycle.json:2: dag `a` has a cycle
key.yaml | period | perod | key.yaml:4: unknown key `perod`; a node has
missing.yaml | target: 1 | target: 7 | missing.yaml:9: target: there is no node `7`; add it
negative.yaml | 5 | -5 | negative.yaml:3: execution_time: `-5` is negative
overflow.yaml | 5 | 99999999999999 | overflow.yaml:3: execution_time: `99999999999999` units of 1ms
path.yaml | 5/.. | 9000000000000/- id: 1/  execution_time: 18000000000000/links:/- source: 0/  target: 1/ | path.yaml:2: the longest path of dag `path` is more than 64 bits
zero.yaml | period: 9 | period: 0 | zero.yaml:4: period: it is 0; give more
late.dag | 10ms | 500000000s offset 18000000000s | late.dag:1: the deadline of the first job of dag `x`
empty.yaml | nodes.. |  | empty.yaml:1: the file is empty
cut.yaml |   target: 1/ |  | cut.yaml:8: this link lacks its `source` or its `target`; give both
both.yaml | target: 1 | target: 1/edges: [] | both.yaml:10: `links` and `edges` both list the edges; keep one
amid.json | 2,4 | 0,4 | amid.json:2: graph `a`: vertex 1 has cost 0 and stands between others
same.json | ]}] | ]},/{"name":"a","c":[1]}] | same.json:3: graph `a` stands here twice, first on line 2; rename one
other.json | graphs | apps | other.json:1: the file has no `graphs`; of JSON a task graph set is read
graph.txt | dag.. | nodes:/ | (read as our format; a name in .yaml or .yml tells RD-Gen's
"#;

#[test]
fn a_broken_file_is_named_with_its_line() {
    let folder = folder("broken");
    for row in WRONG.lines().skip(1) {
        let row = row.replace('/', "\n");
        let [name, from, to, words] = row.split(" | ").collect::<Vec<_>>()[..] else {
            panic!("{row}");
        };
        let good = match name.rsplit_once('.') {
            Some((_, "yaml")) => YAML,
            Some((_, "json")) => JSON,
            _ => DAG,
        };
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
    let rows = r"run --dag escape.dag | escape.dag:1: expected `set`, `dag`, `subtask`, `edge`, `core` or `end`, found `\u{1b}[2J\u{202e}`";
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

/// Writes files of `subtasks` subtasks, one in each format.
fn many(folder: &Path, subtasks: usize) -> [&'static str; 2] {
    let lines = |line: &dyn Fn(usize) -> String| (0..subtasks).map(line).collect::<String>();
    let ours = lines(&|number| format!("subtask s{number} wcet 1us\n"));
    let nodes = lines(&|number| format!("- id: {number}\n  execution_time: 1\n"));
    let ours = format!("dag many period 1s\n{ours}end\n");
    fs::write(folder.join("many.dag"), ours).expect("a file");
    fs::write(folder.join("many.yaml"), format!("nodes:\n{nodes}")).expect("a file");
    ["many.dag", "many.yaml"]
}

#[test]
fn ten_thousand_subtasks_are_read_and_more_than_any_guest_holds_are_2() {
    let folder = folder("many");
    for name in many(&folder, 10_000) {
        let printed = succeed(&folder, &format!("run --print-dag --dag {name}"));
        assert_eq!(printed.matches("\nsubtask ").count(), 10_000, "{name}");
    }
    for name in many(&folder, 20_000) {
        let said = refusal(&folder, ["run", "--dag", name]);
        let words = "its 20000 subtasks, their jobs and the file itself need 5";
        assert!(said.starts_with(&format!("run: {name}: {words}")), "{said}");
    }
}

#[test]
fn every_format_is_printed_as_ours() {
    // A name that no DAG may have, an ending in capitals, and a byte-order mark.
    let folder = folder("printed");
    let odd = "\u{feff}nodes:\n- id: a\n  execution_time: 5\n  end_to_end_deadline: 9\n";
    fs::write(folder.join("#h.YAML"), odd).expect("a file");
    let data = workspace().join("apps/dag-file/examples");
    let data = data.display();
    for file in [
        format!("{data}/rd-gen/gnp_01.yaml"),
        "#h.YAML".into(),
        format!("{data}/stg50.json --graph 50/rand0008"),
    ] {
        let printed = succeed(&folder, &format!("run --print-dag --dag {file}"));
        fs::write(folder.join("printed.dag"), &printed).expect("a file");
        let again = succeed(&folder, "run --print-dag --dag printed.dag");
        assert_eq!(again, printed);
    }
}
