//! The files that a command line names: what is there is kept, and what is no file is
//! refused in words before any work.

use std::ffi::OsStr;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use tool::system::workspace;

/// An empty folder of one test.
fn folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("the tests' folder takes one");
    folder
}

fn tool(words: &[&OsStr], folder: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fass-tool"));
    command.args(words).current_dir(folder).stdin(Stdio::null());
    command.output().expect("the tool can be started")
}

/// Runs a command line that must be refused, and returns what is said.
fn refusal(line: &str, folder: &Path) -> String {
    let words: Vec<&OsStr> = line.split(' ').map(OsStr::new).collect();
    let output = tool(&words, folder);
    let said = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(2), "{line}: {said}");
    assert_eq!(output.stdout, b"", "{line}: {said}");
    said
}

fn demo() -> String {
    let demo = workspace().join("apps/dag-file/examples/demo.dag");
    fs::read_to_string(demo).expect("the demo is there")
}

#[test]
fn no_input_and_no_other_output_is_overwritten() {
    let folder = folder("overwritten");
    fs::write(folder.join("f.dag"), demo()).expect("a file");
    fs::hard_link(folder.join("f.dag"), folder.join("h.log")).expect("a link");
    let run = "run --mode deterministic --timeout 5 ";
    for (line, both) in [
        (
            "run --dag f.dag --trace f.dag",
            "`--dag f.dag` and `--trace f.dag`",
        ),
        (
            "run --dag f.dag --serial h.log",
            "`--dag f.dag` and `--serial h.log`",
        ),
        (
            "run --dag f.dag --dot ./f.dag",
            "`--dag f.dag` and `--dot ./f.dag`",
        ),
        (
            "run --image f.dag --trace f.dag",
            "`--image f.dag` and `--trace f.dag`",
        ),
        (
            "run --serial new --dot new",
            "`--serial new` and `--dot new`",
        ),
        ("trace f.dag -o f.dag", "`f.dag` and `--out f.dag`"),
    ] {
        let line = line.replace("run ", run);
        let said = refusal(&line, &folder);
        let words = format!("{both} are one file, which would be overwritten; name another\n");
        assert!(said.ends_with(&words), "{said}");
    }
    let kept = fs::read_to_string(folder.join("f.dag"));
    assert_eq!(kept.expect("the file"), demo());
    assert!(!folder.join("new").exists());
}

#[test]
fn a_refused_command_empties_no_file() {
    let folder = folder("emptied");
    for name in ["old.log", "old.dot", "base.json"] {
        fs::write(folder.join(name), "kept").expect("a file");
    }
    fs::write(folder.join("bad.dag"), "dag x period 0\nend\n").expect("a file");
    for line in [
        "run --trace old.log --dag bad.dag",
        "run --serial old.log --app none",
        "run --serial old.log --dot old.dot --image bad.dag",
        "run --serial old.log --qemu /none",
        "bench hand-off --save-baseline --baseline base.json --jobs 5",
        "trace bad.dag -o old.log",
    ] {
        refusal(line, &folder);
    }
    for name in ["old.log", "old.dot", "base.json"] {
        assert_eq!(
            fs::read(folder.join(name)).expect("the file"),
            b"kept",
            "{name}"
        );
    }
}

#[test]
fn an_output_that_cannot_be_written_is_2_before_the_work() {
    let folder = folder("unwritable");
    fs::write(folder.join("file"), "").expect("a file");
    for line in [
        "run --serial file/x",
        "run --trace none/x",
        "run --dot file/x",
        "bench join-latency --deterministic --out file/x",
        "bench hand-off --save-baseline --mode deterministic --baseline none/x",
    ] {
        let said = refusal(line, &folder);
        assert_eq!(said.lines().count(), 1, "{said}");
        assert!(said.contains("name another"), "{said}");
    }
}

#[test]
fn what_is_no_file_is_named_and_2_at_once() {
    let folder = folder("devices");
    let status = Command::new("mkfifo").arg(folder.join("pipe")).status();
    assert!(status.expect("mkfifo is there").success());
    fs::create_dir(folder.join("sub.json")).expect("a folder");
    for (line, why) in [
        ("run --dag /dev/zero", "it is a device or a pipe"),
        ("run --dag pipe", "it is a device or a pipe"),
        ("run --image /dev/full", "it is a device or a pipe"),
        ("run --image pipe", "it is a device or a pipe"),
        ("run --serial /dev/full", "it is a device or a pipe"),
        ("run --trace pipe", "it is a named pipe"),
        ("run --dot pipe", "it is a named pipe"),
        ("check-trace sub.json", "it is a folder"),
        ("check-trace /dev/zero", "it is a device or a pipe"),
        ("trace pipe", "it is a device or a pipe"),
        ("oracle bounds /dev/zero", "it is a device or a pipe"),
    ] {
        let said = refusal(line, &folder);
        assert!(said.contains(why), "{line}: {said}");
    }
}

#[test]
fn a_name_need_not_be_utf_8() {
    let folder = folder("bytes");
    let odd = OsStr::from_bytes(b"\xff.dag");
    fs::write(folder.join(odd), demo()).expect("a file");
    let words = ["run", "--print-dag", "--dag"].map(OsStr::new);
    let output = tool(&[&words[..], &[odd]].concat(), &folder);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(output.stdout.starts_with(b"dag "), "{said}");
    for words in [
        "run --cores",
        "run --append",
        "bench",
        "",
        "new-app",
        "soak --only",
    ] {
        let words: Vec<&OsStr> = words.split_whitespace().map(OsStr::new).collect();
        let output = tool(&[&words[..], &[odd]].concat(), &folder);
        let said = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(2), "{words:?}: {said}");
        assert!(said.contains('\u{fffd}'), "{said}");
        assert_eq!(said.lines().count(), 1, "{said}");
    }
}

#[test]
fn what_a_message_repeats_cannot_rewrite_the_terminal() {
    let folder = folder("escapes");
    for word in ["\u{1b}[2J", "a\nb", "\u{202e}abc", "\u{feff}"] {
        for words in [
            vec!["run", "--cores", word],
            vec!["run", word],
            vec!["run", "--app", word],
            vec!["run", "--dag", word],
            vec!["run", "--image", word],
            vec!["check-trace", word],
            vec!["oracle", "bounds", word],
            vec!["bench", word],
            vec!["new-app", word],
            vec!["soak", "--only", word],
        ] {
            let words: Vec<&OsStr> = words.into_iter().map(OsStr::new).collect();
            let output = tool(&words, &folder);
            let said = String::from_utf8(output.stderr).expect("UTF-8");
            assert_eq!(output.status.code(), Some(2), "{words:?}: {said}");
            assert_eq!(said.lines().count(), 1, "{words:?}: {said}");
            let is_raw = |character: char| !matches!(character, ' '..='~' | '\n');
            assert!(!said.contains(is_raw), "{words:?}: {said:?}");
        }
    }
}

#[test]
fn a_file_that_is_given_twice_is_counted_once_or_not_at_all() {
    let folder = folder("twice");
    let cases = workspace().join("tests/oracle/synchronizer.txt");
    fs::copy(cases, folder.join("cases")).expect("a file");
    for line in [
        "oracle synchronizer cases ./cases",
        "check-trace cases cases",
    ] {
        let said = refusal(line, &folder);
        assert!(said.ends_with(" are one file; give it once\n"), "{said}");
    }
    for (line, twice) in [
        ("bench bounds --cores 2,2", "`--cores`: `2` stands twice"),
        (
            "bench native --only join,join",
            "`--only`: `join` stands twice",
        ),
        ("soak --short --seconds 5", "`--short` and `--seconds`"),
        ("soak --rounds 1 --seconds 5", "`--rounds` and `--seconds`"),
        ("bench join-latency --once --mode threads", "`--once`"),
    ] {
        assert!(refusal(line, &folder).contains(twice), "{line}");
    }
}

#[test]
fn too_long_a_command_line_of_the_guest_is_2() {
    let folder = folder("long");
    let words = format!("seed={}", "1".repeat(2100));
    let said = refusal(
        &format!("run --mode deterministic --append {words}"),
        &folder,
    );
    let expected = "run: the guest's command line has 2137 bytes, and 2048 is the most that it \
                    takes; give fewer or shorter words\n";
    assert_eq!(said, expected);
}
