//! The files that a command line names: existing ones are kept, and names of other things than
//! files are refused in words before any work.

use std::ffi::OsStr;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::symlink;
use std::process::Command;

use tool::system::workspace;

use crate::PROGRAM;
use crate::support::{assert_refused, call, folder, refusal};

fn demo() -> String {
    let demo = workspace().join("apps/dag-file/examples/demo.dag");
    fs::read_to_string(demo).expect("the demo is there")
}

#[test]
fn no_input_and_no_other_output_is_overwritten() {
    let folder = folder("overwritten");
    fs::write(folder.join("f.dag"), demo()).expect("a file");
    fs::hard_link(folder.join("f.dag"), folder.join("h.log")).expect("a link");
    let rows = "
run --mode deterministic --dag f.dag --trace f.dag | run: `--dag f.dag` and `--trace f.dag` are one file, which would be overwritten; name another
run --mode deterministic --dag f.dag --serial h.log | run: `--dag f.dag` and `--serial h.log` are one file, which would be overwritten; name another
run --mode deterministic --dag f.dag --keep ./f.dag | run: `--dag f.dag` and `--keep ./f.dag` are one file, which would be overwritten; name another
run --mode deterministic --image f.dag --trace f.dag | run: `--image f.dag` and `--trace f.dag` are one file, which would be overwritten; name another
run --mode deterministic --serial new --keep new | run: `--serial new` and `--keep new` are one file, which would be overwritten; name another
trace f.dag -o f.dag | trace: `f.dag` and `--out f.dag` are one file, which would be overwritten; name another
check-trace f.dag ./f.dag | are one file; give it once";
    assert_refused(&folder, rows);
    let kept = fs::read_to_string(folder.join("f.dag"));
    assert_eq!(kept.expect("the file"), demo());
    assert!(!folder.join("new").exists());
}

#[test]
fn a_refused_command_empties_no_file() {
    let folder = folder("emptied");
    let files = ["old.log", "old.rec"];
    for name in files {
        fs::write(folder.join(name), "kept").expect("a file");
    }
    fs::write(folder.join("bad.dag"), "dag x period 0\nend\n").expect("a file");
    for line in [
        "run --trace old.log --dag bad.dag",
        "run --serial old.log --app none",
        "run --serial old.log --keep old.rec --image bad.dag",
        "run --serial old.log --qemu /none",
        "trace bad.dag -o old.log",
    ] {
        refusal(&folder, line.split(' '));
    }
    for name in files {
        let content = fs::read(folder.join(name)).expect("the file");
        assert_eq!(content, b"kept", "{name}");
    }
}

#[test]
fn what_is_no_file_or_not_the_right_one_is_2_before_the_work() {
    let folder = folder("devices");
    let status = Command::new("mkfifo").arg(folder.join("pipe")).status();
    assert!(status.expect("mkfifo is there").success());
    fs::create_dir(folder.join("sub.json")).expect("a folder");
    fs::write(folder.join("file"), "no image").expect("a file");
    symlink(PROGRAM, folder.join("tool")).expect("a link");
    let rows = "
run --serial file/x | name another
run --trace none/x | name another
run --keep file/x | `--keep file/x`: cannot be written: 
run --keep file/x | name another
run --dag /dev/zero | it is a device or a pipe
run --dag pipe | it is a device or a pipe
run --dag none | none: cannot be read
run --image /dev/full | it is a device or a pipe
run --image pipe | it is a device or a pipe
run --image file | `--image file`: is no image: not a 64-bit little-endian ELF file; name what `cargo
run --image tool | `--image tool`: is no image: it has no PVH note, by which QEMU would enter it; name
run --image sub.json | `--image sub.json`: cannot be read: 
run --image none | `--image none`: cannot be read: 
run --serial /dev/full | it is a device or a pipe
run --trace pipe | it is a named pipe
run --keep pipe | it is a named pipe
check-trace sub.json | it is a folder
check-trace /dev/zero | it is a device or a pipe
trace pipe | it is a device or a pipe";
    assert_refused(&folder, rows);
}

#[test]
fn a_name_need_not_be_utf_8() {
    let folder = folder("bytes");
    let odd = OsStr::from_bytes(b"\xff.dag");
    fs::write(folder.join(odd), demo()).expect("a file");
    let with_odd = |line: &'static str| line.split_whitespace().map(OsStr::new).chain([odd]);
    let printed = call(&folder, with_odd("run --print-dag --dag"));
    assert_eq!(printed.code, Some(0), "{}", printed.complaint);
    assert!(printed.out.starts_with("dag "), "{}", printed.out);
    for line in ["run --cores", "run --append", "", "new-app"] {
        let said = refusal(&folder, with_odd(line));
        assert!(said.contains('\u{fffd}'), "{said}");
    }
}
