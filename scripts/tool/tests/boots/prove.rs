//! `run --prove`: of a folder two boots for each file, and one table.

use std::fs;

use views::json::{self, Value};

use crate::support::{Called, call, folder};

const CHAIN: &str =
    "dag chain period 20ms\nsubtask a wcet 1ms\nsubtask b wcet 2ms\nedge a -> b\nend\n";

/// Runs `run --prove` on a folder of these files, or on one of them.
fn prove(name: &str, options: &str, files: &[(&str, &str)]) -> Called {
    let folder = folder(name);
    for (name, dags) in files {
        fs::write(folder.join(name), dags).expect("there is room");
    }
    let place = match files {
        [(name, _)] => name,
        _ => ".",
    };
    let line = format!("run --prove --jobs 3 {options} --dag {place}");
    call(&folder, line.split(' '))
}

/// Returns the lines of JSON.
fn lines(said: &str) -> Vec<Value> {
    said.lines()
        .filter_map(|line| json::parse(line).ok())
        .collect()
}

fn text<'v>(line: &'v Value, name: &str) -> Option<&'v str> {
    line.get(name).and_then(Value::as_text)
}

/// Twenty DAGs released together take longer than the overheads that the app knows by itself.
#[test]
fn the_run_that_observes_judges_no_bound() {
    let dag = |number| format!("dag x{number} period 100ms\nsubtask a wcet 100us\n");
    let dags: String = (0..20).map(dag).collect();
    let twenty = [("twenty.dag", &*format!("{dags}end\n"))];
    let called = prove("observed", "--cores 2 --mode deterministic", &twenty);
    let said = called.out;
    assert_eq!(called.code, Some(0), "{said}{}", called.complaint);
    assert_eq!(said.matches("\"kind\":\"proof\"").count(), 20, "{said}");
}

/// Observed WCETs have a margin, and the example of lent cores has room for that.
#[test]
fn the_example_of_lent_cores_is_proven_as_its_page_says() {
    let lent = include_str!("../../../../apps/dag-file/examples/lent.dag");
    let options = "--cores 2 --clusters auto --mode deterministic";
    let called = prove("lent", options, &[("lent.dag", lent)]);
    assert_eq!(called.code, Some(0), "{}{}", called.out, called.complaint);
    for test in ["its entries in a table", "what tables leave of its cores"] {
        assert!(called.out.contains(test), "{}", called.out);
    }
}

#[test]
fn overheads_that_are_stated_are_charged_and_none_are_measured() {
    let options = "--append overheads_ns=0,50000,0";
    let called = prove("stated", options, &[("chain.dag", CHAIN)]);
    let said = called.out;
    assert_eq!(called.code, Some(0), "{said}{}", called.complaint);
    let lines = lines(&said);
    let of_kind = |kind: &str| lines.iter().find(|line| text(line, "kind") == Some(kind));
    assert!(of_kind("overheads").is_none(), "{said}");
    let charged = of_kind("proof").and_then(|line| line.get("overheads_ns"));
    // Two subtasks on one path.
    assert_eq!(charged.and_then(Value::as_u64), Some(100_000), "{said}");
}

#[test]
fn a_folder_is_proven_file_by_file_and_a_wrong_one_keeps_none_back() {
    let files = [("chain.dag", CHAIN), ("wrong.dag", "dag wrong\nend\n")];
    let called = prove("folder", "--json", &files);
    let (said, complaint) = (called.out, called.complaint);
    assert!(complaint.contains("wrong.dag:1"), "{complaint}");
    assert_eq!(called.code, Some(2), "{said}{complaint}");
    let lines = lines(&said);
    let [line] = &lines[..] else {
        panic!("{said}{complaint}");
    };
    assert_eq!(text(line, "file"), Some("chain.dag"));
    let number = |name| line.get(name).and_then(Value::as_u64);
    assert!(number("bound_ns") >= number("longest_ns"), "{said}");
    // A chain takes its WCETs; the bound includes them with a margin of a fifth.
    assert!(number("longest_ns") >= Some(3_000_000), "{said}");
}
