//! The files that a command line of the laboratory names, as the tool's own tests hold them of its
//! commands.

use std::fs;

use crate::support::{assert_refused, call, folder};

#[test]
fn what_is_no_file_or_not_the_right_one_is_2_before_the_work() {
    let folder = folder("devices");
    fs::create_dir(folder.join("sub.json")).expect("a folder");
    fs::write(folder.join("file"), "kept").expect("a file");
    let rows = "
bench join-latency --mode deterministic --out file/x | name another
bench hand-off --listing none/x | name another
bench hand-off --listing file --scale | `--scale`
oracle synchronizer file file | are one file; give it once
oracle bounds /dev/zero | it is a device or a pipe
bench bounds sub.json | sub.json: cases are wanted; write its sets as in tests/oracle/lent.txt
bench bounds late.txt | bench bounds: late.txt: case a: a DAG has D > T, which no method here covers; leave the case out
bench bounds torn.txt | bench bounds: torn.txt:4: the file ends where a `end` record should be";
    let set = "case a 2 1\ndag 8 9 1 0\nwcet 3\n";
    fs::write(folder.join("late.txt"), format!("{set}end\n")).expect("a file");
    fs::write(folder.join("torn.txt"), set).expect("a file");
    assert_refused(&folder, rows);
    let kept = fs::read_to_string(folder.join("file"));
    assert_eq!(kept.expect("the file"), "kept");
}

#[test]
fn sets_of_files_are_counted_by_file() {
    let folder = folder("sets");
    // 9 of work by 8 on two cores, and on one.
    let set = |cores: u32| format!("case on-{cores} {cores} 1\ndag 8 8 3 0\nwcet 3 3 3\nend\n");
    fs::write(folder.join("both.txt"), set(2) + &set(1)).expect("a file");
    fs::write(folder.join("one.txt"), set(1)).expect("a file");
    let printed = call(&folder, ["bench", "bounds", "both.txt", "one.txt"]);
    assert_eq!(printed.code, Some(0), "{}", printed.complaint);
    let rows = printed.out.lines().skip(2);
    let rows: Vec<Vec<&str>> = rows.map(|row| row.split_whitespace().collect()).collect();
    let row = |count, share, file| [&[count][..], &[share; 7], &[file]].concat();
    let rows_of_files = [row("2", "50.0", "both.txt"), row("1", "0.0", "one.txt")];
    assert_eq!(rows, rows_of_files);
}
