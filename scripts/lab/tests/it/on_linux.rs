//! The evaluation on Linux, where no guest can be booted.

use std::fs;
use std::path::PathBuf;

use crate::support::{Called, command, folder};

/// Makes a folder of all programs that there are but QEMU's and the one that installs it.
fn programs_without_qemu() -> PathBuf {
    let folder = folder("without-qemu");
    let path = std::env::var_os("PATH").expect("there is one");
    for file in std::env::split_paths(&path).filter_map(|path| fs::read_dir(path).ok()) {
        for file in file.flatten() {
            let name = file.file_name().to_string_lossy().into_owned();
            if !name.starts_with("qemu-") && name != "apt-get" {
                // Of two programs of one name the first counts.
                let _ = std::os::unix::fs::symlink(file.path(), folder.join(name));
            }
        }
    }
    folder
}

#[test]
fn the_evaluation_is_repeated_with_its_baselines_without_qemu() {
    let folder = folder("evaluation");
    let bench =
        "bench join-latency --on linux --subtasks 2 --policies fass,exact --jobs 4 --out out";
    let mut command = command(&folder, bench.split(' '));
    let output = command.env("PATH", programs_without_qemu()).output();
    let called = Called::of(output.expect("the tool can be started"));
    let said = called.out;
    assert_eq!(called.code, Some(0), "{said}{}", called.complaint);
    let conditions = "2 conditions of 4 jobs; mode linux, 4 cores";
    assert!(said.contains(conditions), "{said}");
    for joins in ["FasS (DAG)", "ExactTime"] {
        let row = said.lines().find(|line| line.contains(joins));
        let row: Vec<&str> = row.expect("a row").split_whitespace().collect();
        // All four jobs are joined, each with its own values.
        let mut parts = row.windows(3);
        assert!(parts.any(|part| part == ["1.000", "4", "0"]), "{said}");
    }
    assert!(folder.join("out/summary.json").is_file());
}
