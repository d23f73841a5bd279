//! `run --prove`: of a folder two boots for each file, and one table.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio, id};

use tool::json::{self, Value};

/// A folder of this test's own, removed with this value.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("prove-{name}-{}", id()));
        fs::create_dir_all(&folder).expect("there is room");
        Self(folder)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Runs `run --prove` and returns its output.
fn prove(words: &[&str], place: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fass-tool"))
        .args(["run", "--prove", "--jobs", "3"])
        .args(words)
        .arg("--dag")
        .arg(place)
        .stdin(Stdio::null())
        .output()
        .expect("the tool can be started")
}

const CHAIN: &str =
    "dag chain period 20ms\nsubtask a wcet 1ms\nsubtask b wcet 2ms\nedge a -> b\nend\n";

/// Twenty DAGs released together take longer than the overheads that the app knows by itself.
#[test]
fn the_run_that_observes_judges_no_bound() {
    let folder = Folder::new("observed");
    let file = folder.0.join("twenty.dag");
    let dag = |number| format!("dag x{number} period 100ms\nsubtask a wcet 100us\n");
    let dags: String = (0..20).map(dag).collect();
    fs::write(&file, dags + "end\n").expect("there is room");
    let output = prove(&["--cores", "2", "--mode", "deterministic"], &file);
    let said = String::from_utf8_lossy(&output.stdout);
    let complaints = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}{complaints}");
    let proofs = said
        .lines()
        .filter(|line| line.contains("\"kind\":\"proof\""));
    assert_eq!(proofs.count(), 20, "{said}");
}

#[test]
fn overheads_that_are_stated_are_charged_and_none_are_measured() {
    let folder = Folder::new("stated");
    let file = folder.0.join("chain.dag");
    fs::write(&file, CHAIN).expect("there is room");
    let output = prove(&["--append", "overheads_ns=0,50000,0"], &file);
    let said = String::from_utf8_lossy(&output.stdout);
    let complaints = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}{complaints}");
    let lines: Vec<Value> = said
        .lines()
        .filter_map(|line| json::parse(line).ok())
        .collect();
    let of_kind = |kind: &str| {
        let mut lines = lines.iter();
        lines.find(|line| line.get("kind").and_then(Value::as_text) == Some(kind))
    };
    assert!(of_kind("overheads").is_none(), "{said}");
    let proof = of_kind("proof").expect("a line a DAG");
    let charged = proof.get("overheads_ns").and_then(Value::as_u64);
    // Two subtasks on one path.
    assert_eq!(charged, Some(100_000), "{said}");
}

#[test]
fn a_folder_is_proven_file_by_file_and_a_wrong_one_keeps_none_back() {
    let folder = Folder::new("folder");
    fs::write(folder.0.join("chain.dag"), CHAIN).expect("there is room");
    fs::write(folder.0.join("wrong.dag"), "dag wrong\nend\n").expect("there is room");
    let output = prove(&["--json"], &folder.0);
    let said = String::from_utf8_lossy(&output.stdout);
    let complaints = String::from_utf8_lossy(&output.stderr);
    assert!(complaints.contains("wrong.dag:1"), "{complaints}");
    assert_eq!(output.status.code(), Some(2), "{said}{complaints}");
    let lines: Vec<Value> = said
        .lines()
        .filter_map(|line| json::parse(line).ok())
        .collect();
    let [line] = &lines[..] else {
        panic!("{said}{complaints}");
    };
    let number = |name| line.get(name).and_then(Value::as_u64);
    assert_eq!(line.get("file").and_then(Value::as_text), Some("chain.dag"));
    assert!(number("bound_ns") >= number("longest_ns"), "{said}");
    // A chain takes its WCETs, which the bound has with a margin of a fifth.
    assert!(number("longest_ns") >= Some(3_000_000), "{said}");
}
