//! The engine from outside: its answers natively, and the same of its wasm.

#![forbid(unsafe_code)]
#![allow(clippy::unwrap_used, reason = "what is not there fails the test")]

mod answers;
mod in_node;
mod machines;
mod mutated;
mod oracle;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;

use views::json::{self, Value};

/// Returns the folder of the workspace.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Reads a file of the workspace.
fn file(path: &str) -> Vec<u8> {
    std::fs::read(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Makes a request of its words and body.
fn request(words: &str, body: &[u8]) -> Vec<u8> {
    [words.as_bytes(), b"\n", body].concat()
}

/// Returns the native answer to a request.
fn native(request: &[u8]) -> Vec<u8> {
    output(Command::new(env!("CARGO_BIN_EXE_fass-page")), request)
}

/// Returns the output of a program, which must end well and without a complaint.
fn output(mut program: Command, input: &[u8]) -> Vec<u8> {
    let streams = program.stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut child = streams.stderr(Stdio::piped()).spawn().expect("it starts");
    let mut pipe = child.stdin.take().expect("it is a pipe");
    let output = thread::scope(|scope| {
        // A program that has failed reads no more.
        scope.spawn(move || drop(pipe.write_all(input)));
        child.wait_with_output().expect("it ends")
    });
    let complaint = String::from_utf8_lossy(&output.stderr);
    let shown = String::from_utf8_lossy(&input[..input.len().min(500)]);
    let is_well = output.status.success() && complaint.is_empty();
    assert!(is_well, "{complaint} of {shown}");
    output.stdout
}

/// Plays a file, or asks for something else, natively.
fn answer(words: &str, body: &[u8]) -> Answer {
    Answer::read(native(&request(words, body)))
}

/// An answer that was read.
struct Answer {
    head: Value,
    columns: Vec<u8>,
}

impl Answer {
    fn read(bytes: Vec<u8>) -> Self {
        let length = u32::from_le_bytes(bytes[..4].try_into().expect("four bytes"));
        let end = 4 + usize::try_from(length).expect("it fits");
        assert_eq!(end % 8, 0);
        let head = std::str::from_utf8(&bytes[4..end]).expect("a head of text");
        Self {
            head: json::parse(head.trim_end()).unwrap_or_else(|error| panic!("{error:?}: {head}")),
            columns: bytes[end..].to_vec(),
        }
    }

    /// Returns a member of the head, by members and numbers of elements.
    fn at(&self, path: &str) -> &Value {
        let step = |value, step: &str| match step.parse::<usize>() {
            Ok(number) => Value::elements(value).get(number),
            Err(_) => value.get(step),
        };
        let found = path.split('.').try_fold(&self.head, step);
        found.unwrap_or_else(|| panic!("no {path} in {:?}", self.head))
    }

    fn number(&self, path: &str) -> u64 {
        self.at(path).as_u64().expect(path)
    }

    fn text(&self, path: &str) -> &str {
        self.at(path).as_text().expect(path)
    }

    /// Returns a column as whole numbers; `None` where a time is not known.
    fn column(&self, name: &str) -> Vec<Option<u64>> {
        let is_it = |it: &&Value| it.get("name").unwrap().as_text() == Some(name);
        let column = self.at("columns").elements().iter().find(is_it);
        let of = |member| column.expect(name).get(member).unwrap();
        let at = |member| usize::try_from(of(member).as_u64().unwrap()).unwrap();
        let (from, count) = (at("from"), at("count"));
        assert_eq!(from % 8, 0);
        let bytes = &self.columns[from..];
        let number = |at: usize| match of("type").as_text().unwrap() {
            "Float64Array" => whole(f64::from_le_bytes(bytes.as_chunks().0[at])),
            "Uint32Array" => Some(u32::from_le_bytes(bytes.as_chunks().0[at]).into()),
            _ => Some(bytes[at].into()),
        };
        (0..count).map(number).collect()
    }
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "times are whole and below 2^53"
)]
fn whole(ns: f64) -> Option<u64> {
    (!ns.is_nan()).then_some(ns as u64)
}
