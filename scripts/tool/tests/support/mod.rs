//! Calling the tool, or the laboratory, as a person does: `PROGRAM` of the test's root.
//!
//! Command lines that must be refused are tables: a row is the line, ` | `, and the message.

#![allow(dead_code, reason = "each program uses a part of this")]

use std::ffi::OsStr;
use std::fs;
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use tool::system::workspace;
use tool::{install, qemu, system};

/// As QEMU 7.2 does where the host's KVM does not know an instruction.
pub(crate) const STOPS: &str = "echo 'KVM internal error. Suberror: 1' >&2; exec sleep 600";

/// The result of a call.
pub(crate) struct Called {
    pub(crate) code: Option<i32>,
    pub(crate) out: String,
    pub(crate) complaint: String,
}

impl Called {
    pub(crate) fn of(output: Output) -> Called {
        Called {
            code: output.status.code(),
            out: String::from_utf8(output.stdout).expect("UTF-8"),
            complaint: String::from_utf8(output.stderr).expect("UTF-8"),
        }
    }
}

/// An empty folder of one test.
pub(crate) fn folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("the tests' folder takes one");
    folder
}

pub(crate) fn command<W: AsRef<OsStr>>(
    folder: &Path,
    words: impl IntoIterator<Item = W>,
) -> Command {
    let mut command = Command::new(crate::PROGRAM);
    command.args(words).current_dir(folder).stdin(Stdio::null());
    command
}

/// Calls the tool in a folder.
pub(crate) fn call<W: AsRef<OsStr>>(folder: &Path, words: impl IntoIterator<Item = W>) -> Called {
    let output = command(folder, words).output();
    Called::of(output.expect("the tool can be started"))
}

/// Calls the tool, which must succeed, and returns its output.
pub(crate) fn succeed(folder: &Path, line: &str) -> String {
    let called = call(folder, line.split(' '));
    let complaint = called.complaint;
    assert_eq!(called.code, Some(0), "{line}: {}{complaint}", called.out);
    called.out
}

/// Calls the tool, which must refuse the words in one line, and returns that.
pub(crate) fn refusal<W: AsRef<OsStr>>(
    folder: &Path,
    words: impl IntoIterator<Item = W>,
) -> String {
    let called = call(folder, words);
    let said = called.complaint;
    assert_eq!(called.code, Some(2), "{said}");
    assert_eq!(called.out, "", "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    said.trim_end().into()
}

/// Asserts that each row's command line is refused with the words of the row. Words that begin with
/// the command's name are the whole message.
pub(crate) fn assert_refused(folder: &Path, rows: &str) {
    for row in rows.lines().filter(|row| !row.is_empty()) {
        let (line, words) = row.split_once(" | ").expect(row);
        let said = refusal(folder, line.split(' '));
        let (name, _) = said.split_once(": ").expect(&said);
        let is_right = match words.starts_with(&format!("{name}: ")) {
            true => said == words,
            false => said.contains(words),
        };
        assert!(is_right, "{said}\nnot: {words}");
    }
}

/// Runs the tool with the other ends of both its outputs closed; returns its exit code.
pub(crate) fn code_without_readers(line: &str) -> Option<i32> {
    let closed = || {
        let (reader, writer) = io::pipe().expect("a pipe");
        drop(reader);
        writer
    };
    let mut command = command(workspace(), line.split(' '));
    command.stdout(closed()).stderr(closed());
    let status = command.status().expect("the tool can be started");
    status.code()
}

/// Asserts that each of these commands explains itself and names an unknown option.
pub(crate) fn assert_explained(commands: &str) {
    for name in commands.split(", ") {
        let (help, unknown) = (format!("{name} --help"), format!("{name} --frobnicate"));
        let explained = call(workspace(), help.split(' '));
        assert_eq!(explained.code, Some(0), "{name}");
        let usage = format!("usage: ./scripts/{name} ");
        assert!(explained.out.contains(&usage), "{}", explained.out);
        let script = name.split(' ').next().unwrap_or_default();
        assert!(workspace().join("scripts").join(script).is_file(), "{name}");

        let said = refusal(workspace(), unknown.split(' '));
        let words = format!("{name}: unknown option `--frobnicate`; ");
        assert!(said.starts_with(&words), "{said}");
        assert!(said.ends_with("--help"), "{said}");

        assert_eq!(code_without_readers(&help), Some(0), "{name}");
        assert_eq!(code_without_readers(&unknown), Some(2), "{name}");
    }
}

/// Asserts that a command fails whose output finds no room, in words of the program `name`.
pub(crate) fn assert_needs_room(name: &str, line: &str) {
    let full = fs::File::create("/dev/full").expect("the device is there");
    let mut command = command(workspace(), line.split(' '));
    let output = command.stdout(full).output().expect("it starts");
    let said = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(1), "{line}: {said}");
    let words = format!("{name}: standard output could not be written: No space left on device");
    assert!(said.starts_with(&words), "{said}");
}

/// Asserts that no refusal of these lines repeats what a terminal would obey, which stands for
/// `WORD` in each.
pub(crate) fn assert_visible(lines: &[&str]) {
    for word in ["\u{1b}[2J", "a\nb", "\u{202e}abc", "\u{feff}"] {
        for line in lines {
            let words = line.split(' ').map(|given| given.replace("WORD", word));
            let said = refusal(workspace(), words);
            let is_raw = |character: char| !matches!(character, ' '..='~');
            assert!(!said.contains(is_raw), "{line}: {said:?}");
        }
    }
}

/// Makes a folder with a program of QEMU's name that does `under_kvm` in place of KVM.
pub(crate) fn stub(name: &str, under_kvm: &str) -> PathBuf {
    install::ensure_qemu().expect("QEMU");
    let folder = folder(name);
    let real = system::find_program(qemu::PROGRAM).expect("QEMU");
    let real = real.display();
    let script = format!(
        "#!/bin/sh\ncase \"$*\" in *'-accel kvm'*) {under_kvm};; esac\nexec {real} \"$@\"\n"
    );
    let stub = folder.join(qemu::PROGRAM);
    fs::write(&stub, script).expect("the script is written");
    fs::set_permissions(&stub, fs::Permissions::from_mode(0o755)).expect("it is ours");
    folder
}

/// Calls the tool with a folder in front of the `PATH`.
pub(crate) fn call_by(stub: &Path, line: &str) -> Called {
    let path = std::env::var("PATH").expect("a PATH");
    let mut command = command(system::workspace(), line.split(' '));
    command.env("PATH", format!("{}:{path}", stub.display()));
    Called::of(command.output().expect("the tool starts"))
}

/// Asserts that each of these commands refuses a KVM that it is to use, and that does not work.
pub(crate) fn assert_kvm_refused(lines: &[&str]) {
    let stub = stub("refused", STOPS);
    for line in lines {
        let called = call_by(&stub, line);
        assert_eq!(called.code, Some(1), "{line}");
        let complaint = called.complaint;
        // Where an image is built first, a slow host says how long that takes, or who else builds.
        let is_of_build =
            |line: &&str| line.ends_with(" s so far") || line.starts_with("waiting for another");
        let mut lines = complaint.lines().filter(|line| !is_of_build(line));
        let refusal = lines.next().unwrap_or_default();
        assert_eq!(lines.next(), None, "{line}: {complaint}");
        let words = "`--mode kvm`: KVM is of no use here: KVM could not run the guest any further, \
                     QEMU was killed (KVM internal error. Suberror: 1); use deterministic or threads";
        assert!(refusal.contains(words), "{line}: {complaint}");
    }
}
