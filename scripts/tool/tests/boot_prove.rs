//! `run --prove` of a folder: two boots for each file, and one table.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Stdio, id};

use tool::json::{self, Value};

/// A folder of this test's own, removed with this value.
struct Folder(PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[test]
fn a_folder_is_proven_file_by_file_and_a_wrong_one_keeps_none_back() {
    let folder = Folder(std::env::temp_dir().join(format!("prove-{}", id())));
    fs::create_dir_all(&folder.0).expect("there is room");
    let chain = "dag chain period 20ms\nsubtask a wcet 1ms\nsubtask b wcet 2ms\nedge a -> b\nend\n";
    fs::write(folder.0.join("chain.dag"), chain).expect("there is room");
    fs::write(folder.0.join("wrong.dag"), "dag wrong\nend\n").expect("there is room");
    let output = Command::new(env!("CARGO_BIN_EXE_fass-tool"))
        .args(["run", "--prove", "--json", "--jobs", "3", "--dag"])
        .arg(&folder.0)
        .stdin(Stdio::null())
        .output()
        .expect("the tool can be started");
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
