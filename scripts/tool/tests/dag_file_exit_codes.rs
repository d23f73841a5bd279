//! `run --dag` as a person calls it with a file that is wrong: refused before
//! anything boots, as FILE:LINE, offender and remedy, with exit code 2.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use tool::system::workspace;

/// Writes a file of this test's own.
fn file(name: &str, text: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::write(&path, text).expect("the test's folder takes a file");
    path
}

fn run(words: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fass-tool"));
    command.arg("run").args(words);
    command.output().expect("the tool can be started")
}

/// Returns what the tool says of a file that it refuses.
fn refusal(words: &[&str]) -> String {
    let output = run(words);
    let said = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert_eq!(output.stdout, b"", "{said}");
    said
}

#[test]
fn a_broken_file_is_2_and_named_with_its_line() {
    let node = "nodes:\n- id: 0\n  execution_time: 5\n  period: 9\n- id: 1\n  execution_time: 2\n";
    let link = |source, target| format!("- source: {source}\n  target: {target}\n");
    let dag = "dag x period 10ms\nsubtask a wcet 1ms\nsubtask b wcet 1ms\nedge a -> b\n";
    let graph = r#"{"graphs":[{"name":"g","c":[1,2],"edges":[[0,1],[1,0]]}]}"#;
    for (name, text, words) in [
        (
            "cycle.dag",
            format!("{dag}edge b -> a\nend"),
            "cycle.dag:5: dag `x` has a cycle: subtask `a` -> subtask `b` -> subtask `a`; remove one",
        ),
        (
            "cycle.yaml",
            format!("{node}links:\n{}{}", link(0, 1), link(1, 0)),
            "cycle.yaml:10: dag `cycle` has a cycle",
        ),
        (
            "cycle.json",
            graph.into(),
            "cycle.json:1: dag `g` has a cycle",
        ),
        (
            "key.dag",
            format!("{dag}subtask c wect 1ms\nend"),
            "key.dag:5: unknown key `wect`; a subtask has",
        ),
        (
            "key.yaml",
            node.replace("period", "perod"),
            "key.yaml:4: unknown key `perod`; a node has",
        ),
        (
            "missing.dag",
            format!("{dag}edge a -> z\nend"),
            "missing.dag:5: no subtask `z` stands before this line",
        ),
        (
            "missing.yaml",
            format!("{node}links:\n{}", link(0, 7)),
            "missing.yaml:9: target: there is no node `7`; add it",
        ),
        (
            "negative.dag",
            dag.replace("10ms", "-10ms"),
            "negative.dag:1: period: `-10ms` is negative; give",
        ),
        (
            "negative.yaml",
            node.replace("5", "-5"),
            "negative.yaml:3: execution_time: `-5` is negative",
        ),
        (
            "overflow.dag",
            dag.replace("10ms", "99999999999s"),
            "overflow.dag:1: period: `99999999999s` is more than 64 bits",
        ),
        (
            "overflow.yaml",
            node.replace("5", "99999999999999"),
            "overflow.yaml:3: execution_time: `99999999999999` units of 1ms",
        ),
        (
            "path.yaml",
            node.replace("5", "9000000000000")
                .replace("time: 2", "time: 18000000000000")
                + &format!("links:\n{}", link(0, 1)),
            "path.yaml:2: the longest path of dag `path` is more than 64 bits",
        ),
        (
            "zero.yaml",
            node.replace("period: 9", "period: 0"),
            "zero.yaml:4: period: it is 0; give more",
        ),
        (
            "late.dag",
            format!(
                "{}end",
                dag.replace("10ms", "500000000s offset 18000000000s")
            ),
            "late.dag:1: the deadline of the first job of dag `x`",
        ),
        (
            "empty.dag",
            String::new(),
            "empty.dag:1: the file ends where a `dag` record should be; it is empty",
        ),
        (
            "empty.yaml",
            String::new(),
            "empty.yaml:1: the file is empty",
        ),
        (
            "cut.dag",
            dag.into(),
            "cut.dag:5: the file ends where `end` should be; a part of it is missing",
        ),
        (
            "cut.yaml",
            format!("{node}links:\n{}", link(0, 1)).replace("  target: 1\n", ""),
            "cut.yaml:8: this link lacks its `source` or its `target`; give both",
        ),
    ] {
        let path = file(name, &text);
        let said = refusal(&["--dag", path.to_str().expect("UTF-8")]);
        assert!(
            said.starts_with("run: ") && said.contains(words),
            "{said}  not: {words}"
        );
        assert!(said.contains(&format!("{}:", path.display())), "{said}");
    }
}

#[test]
fn nonsense_is_2_and_named_with_its_line() {
    let dag = "dag x period 10ms\nsubtask a wcet 1ms\n";
    let graph = |graph: &str| format!("{{\"graphs\":[\n{graph}]}}");
    for (name, text, words) in [
        (
            "both.yaml",
            "nodes:\n- id: a\n  execution_time: 5\n  period: 100\nlinks:\n- source: a\n  target: a\n\
             edges: []\n"
                .into(),
            "both.yaml:8: `links` and `edges` both list the edges; keep one",
        ),
        (
            "amid.json",
            graph(r#"{"name":"a","c":[3,0,4],"edges":[[0,1],[1,2]]}"#),
            "amid.json:2: graph `a`: vertex 1 has cost 0 and stands between others",
        ),
        (
            "same.json",
            graph("{\"name\":\"a\",\"c\":[1]},\n{\"name\":\"a\",\"c\":[1]}"),
            "same.json:3: graph `a` stands here twice, first on line 2; rename one",
        ),
        (
            "other.json",
            "{\"apps\":[]}".into(),
            "other.json:1: the file has no `graphs`; of JSON a task graph set is read",
        ),
        (
            "brace.dag",
            dag.replace("dag x", "dag {x") + "end",
            "brace.dag:1: `{x` is no name",
        ),
        (
            "zero.dag",
            dag.replace("1ms", "0ns") + "end",
            "zero.dag:2: wcet: it is 0",
        ),
        (
            "escape.dag",
            "\u{1b}[2J\u{202e}\n".into(),
            "escape.dag:1: expected `set`, `dag`, `subtask`, `edge` or `end`, found \
             `\\u{1b}[2J\\u{202e}`",
        ),
        (
            "graph.txt",
            "nodes:\n".into(),
            "(read as our format; a name in .yaml or .yml tells RD-Gen's",
        ),
    ] {
        let path = file(name, &text);
        let said = refusal(&["--dag", path.to_str().expect("UTF-8")]);
        assert!(said.contains(words), "{said}  not: {words}");
        assert_eq!(said.lines().count(), 1, "{said}");
    }
}

#[test]
fn many_faults_are_told_in_part() {
    let subtasks: String = (0..1000)
        .map(|n| format!("subtask s{n} wcet 2s\n"))
        .collect();
    let path = file("faults.dag", &format!("dag x period 1s\n{subtasks}end\n"));
    let said = refusal(&["--dag", path.to_str().expect("UTF-8")]);
    assert_eq!(said.lines().count(), 21, "{said}");
    assert!(
        said.ends_with("faults.dag:22: and 980 more faults from this line on\n"),
        "{said}"
    );
}

#[test]
fn options_that_do_not_fit_are_2() {
    let good = file("good.dag", "dag x period 1ms\nsubtask a wcet 1us\nend\n");
    let good = good.to_str().expect("UTF-8");
    for (words, reason) in [
        (
            vec!["--dag", "/no/such.dag"],
            "/no/such.dag: cannot be read",
        ),
        (
            vec!["--execution", "wcet"],
            "`--execution` needs `--dag FILE`",
        ),
        (
            vec!["--dag", good, "--app", "soak"],
            "`--app` and `--dag` exclude each other",
        ),
        (
            vec!["--dag", good, "--jobs", "1", "--seconds", "1"],
            "`--jobs` and `--seconds` exclude",
        ),
        (
            vec!["--dag", good, "--jobs", "0"],
            "`--jobs 0` has no end, which is for fork-join; with `--dag` give at least 1",
        ),
        (
            vec!["--dag", good, "--execution", "most"],
            "`--execution`: `most`: give wcet, uniform:",
        ),
        (
            vec!["--dag", good, "--unit", "1"],
            "`--unit`: `1` has no unit",
        ),
        (
            vec!["--dag", good, "--graph", "g"],
            "`--graph g` is for a set of task graphs",
        ),
    ] {
        let said = refusal(&words);
        assert!(said.contains(reason), "{said}  not: {reason}");
    }
}

/// Writes files of `subtasks` subtasks, one in each format.
fn many(subtasks: usize) -> [String; 2] {
    let lines = |line: &dyn Fn(usize) -> String| (0..subtasks).map(line).collect::<String>();
    let ours = lines(&|number| format!("subtask s{number} wcet 1us\n"));
    let nodes = lines(&|number| format!("- id: {number}\n  execution_time: 1\n"));
    [
        (
            format!("many-{subtasks}.dag"),
            format!("dag many period 1s\n{ours}end\n"),
        ),
        (format!("many-{subtasks}.yaml"), format!("nodes:\n{nodes}")),
    ]
    .map(|(name, text)| file(&name, &text).to_str().expect("UTF-8").into())
}

#[test]
fn ten_thousand_subtasks_are_read_and_more_than_any_guest_holds_are_2() {
    for path in many(10_000) {
        let output = run(&["--print-dag", "--dag", &path]);
        assert_eq!(output.status.code(), Some(0), "{path}");
        let printed = String::from_utf8(output.stdout).expect("UTF-8");
        assert_eq!(printed.matches("\nsubtask ").count(), 10_000, "{path}");
    }
    for path in many(20_000) {
        let said = refusal(&["--dag", &path]);
        let words =
            format!("run: {path}: its 20000 subtasks, their jobs and the file itself need 5");
        assert!(said.starts_with(&words), "{said}");
    }
}

#[test]
fn every_format_is_printed_as_ours() {
    let data = workspace().join("apps/dag-file/examples");
    let (yaml, json) = (data.join("rd-gen/gnp_01.yaml"), data.join("stg50.json"));
    // A name that no DAG may have, an ending in capitals, and a byte-order mark.
    let odd = file(
        "#h.YAML",
        "\u{feff}nodes:\n- id: a\n  execution_time: 5\n  end_to_end_deadline: 9\n",
    );
    for words in [
        vec!["--print-dag", "--dag", yaml.to_str().expect("UTF-8")],
        vec!["--print-dag", "--dag", odd.to_str().expect("UTF-8")],
        vec![
            "--print-dag",
            "--graph",
            "50/rand0008",
            "--dag",
            json.to_str().expect("UTF-8"),
        ],
    ] {
        let output = run(&words);
        assert_eq!(output.status.code(), Some(0));
        let printed = String::from_utf8(output.stdout).expect("UTF-8");
        let again = file("printed.dag", &printed);
        let output = run(&["--print-dag", "--dag", again.to_str().expect("UTF-8")]);
        assert_eq!(String::from_utf8(output.stdout).expect("UTF-8"), printed);
    }
}

#[test]
fn a_drawing_that_cannot_be_written_is_refused_before_anything_boots() {
    let said = refusal(&["--dot", "/no/such/folder/dags.dot"]);
    assert!(
        said.starts_with("run: `--dot /no/such/folder/dags.dot`: cannot be written:"),
        "{said}"
    );
    assert!(said.ends_with("; name another file\n"), "{said}");
}

#[test]
fn what_is_for_one_file_is_refused_for_a_folder() {
    let folder = workspace().join("apps/dag-file/examples/rd-gen");
    let folder = folder.to_str().expect("a path of UTF-8");
    for words in [&["--dot", "dags.dot"][..], &["--console"], &["--print-dag"]] {
        let said = refusal(&[&["--dag", folder], words].concat());
        let expected = format!(
            "run: `{}` is for one file; name one with `--dag`\n",
            words[0]
        );
        assert_eq!(said, expected);
    }
}
