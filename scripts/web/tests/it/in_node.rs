//! The engine's wasm answers as the engine does natively: byte by byte, in node.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use crate::{file, mutated, native, oracle, output, request, root};

/// Returns the wasm, built once.
fn wasm() -> &'static Path {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    BUILT.get_or_init(|| {
        let build =
            "build --quiet --profile page --target wasm32-wasip1 -p page --target-dir target";
        let mut cargo = Command::new(env!("CARGO"));
        let built = cargo.args(build.split(' ')).current_dir(root()).status();
        assert!(built.is_ok_and(|status| status.success()), "cargo {build}");
        root().join("target/wasm32-wasip1/page/fass-page.wasm")
    })
}

/// Returns the answers of the wasm.
fn in_node(requests: &[Vec<u8>]) -> Vec<Vec<u8>> {
    let framed = |bytes: &Vec<u8>| {
        let length = u32::try_from(bytes.len()).expect("a short one");
        [&length.to_le_bytes(), &bytes[..]].concat()
    };
    let input: Vec<u8> = requests.iter().flat_map(framed).collect();
    let mut node = Command::new("node");
    node.arg(root().join("scripts/web/tests/run.mjs"))
        .arg(wasm());
    let output = output(node, &input);
    let (mut rest, mut answers) = (&output[..], Vec::new());
    while let Some((length, after)) = rest.split_first_chunk() {
        let (answer, after) = after.split_at(u32::from_le_bytes(*length) as usize);
        answers.push(answer.to_vec());
        rest = after;
    }
    answers
}

/// Compares the answers to requests, each of which has a name.
fn compare(requests: Vec<(String, Vec<u8>)>) {
    let (names, requests): (Vec<_>, Vec<_>) = requests.into_iter().unzip();
    let answers = in_node(&requests);
    assert_eq!(answers.len(), requests.len());
    for ((name, request), answer) in names.iter().zip(&requests).zip(&answers) {
        assert!(*answer == native(request), "{name} is answered otherwise");
    }
}

#[test]
fn reference_cases_are_answered_alike() {
    let cases = oracle::all();
    assert_eq!(cases.len(), 120 + 60 + 60 + 60 + 40);
    let asked = |case: oracle::Case| (case.name, request(&case.words, case.file.as_bytes()));
    compare(cases.into_iter().map(asked).collect());
}

#[test]
fn examples_apps_records_and_pictures_are_answered_alike() {
    let mut requests = Vec::new();
    for example in ["accelerator", "demo", "drive", "hogs", "lent", "policies"] {
        let body = file(&format!("apps/dag-file/examples/{example}.dag"));
        for words in [
            "cores=2",
            "cores=4 policy=edf clusters=auto",
            "preemption=off overheads=kernel execution=uniform:0.2..1",
        ] {
            for what in ["play", "record-of-play", "svg-of-play", "job of=play"] {
                let words = format!("{what} {words} periods=3");
                requests.push((format!("{example} {words}"), request(&words, &body)));
            }
        }
    }
    for app in ["drone", "stamps"] {
        let words = format!("record-of-play app={app}");
        let record = native(&request(&words, b""));
        requests.push((words.clone(), request(&words, b"")));
        requests.push((app.into(), request("open", &record)));
    }
    compare(requests);
}

#[test]
fn spoilt_requests_are_answered_alike() {
    let names = (0..).map(|number| format!("spoilt request {number}"));
    compare(names.zip(mutated::spoilt(200, 2)).collect());
}
