//! Calling the tool as a person does.
//!
//! Command lines that must be refused are tables: a row is the line, ` | `, and the message.

#![allow(dead_code, reason = "each program uses a part of this")]

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

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
    let mut command = Command::new(env!("CARGO_BIN_EXE_fass-tool"));
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
