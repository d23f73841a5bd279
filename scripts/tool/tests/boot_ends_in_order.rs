//! Ctrl-C, and the timeout, end a run in order: by real signals, on the machine in QEMU and on
//! Linux. The counts, the recording and the trace are there and whole; the second ctrl-C kills.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use linux::EndSignals;
use tool::protocol::Transcript;
use tool::system::workspace;

/// The exit code after ctrl-C.
const BY_PERSON: Option<i32> = Some(130);

fn tool(words: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fass-tool"));
    command.current_dir(workspace()).stdin(Stdio::null());
    command.args(words.split(' '));
    command
}

/// A file of ours that is not there yet.
fn fresh(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_file(&path);
    path
}

/// Starts a run, and returns it with what it says after the line that has this in it.
fn start(words: &str, awaited: &str) -> (Child, BufReader<impl Read>) {
    let mut command = tool(words);
    let child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    let mut child = child.expect("the tool can be started");
    let mut said = BufReader::new(child.stdout.take().expect("it is a pipe"));
    let mut line = String::new();
    while !line.contains(awaited) {
        line.clear();
        let bytes = said.read_line(&mut line).expect("UTF-8");
        assert!(bytes > 0, "{words}: it ended before `{awaited}`");
    }
    (child, said)
}

/// Waits for the end; returns what it has said on standard output, and its exit code.
fn end(mut child: Child, mut said: BufReader<impl Read>) -> (String, Option<i32>) {
    let mut text = String::new();
    said.read_to_string(&mut text).expect("UTF-8");
    let status = child.wait().expect("it is ours");
    (text, status.code())
}

/// Makes sure that a trace breaks no rule, and returns how many of its events close a DAG.
fn closings(trace: &Path) -> usize {
    let words = format!("check-trace --bound-us 5000000 {}", trace.display());
    let output = tool(&words).output().expect("the tool can be started");
    assert!(output.status.success(), "{output:?}");
    let text = fs::read_to_string(trace).expect("it is there");
    text.matches("\"closed\"").count()
}

#[test]
fn the_first_ctrl_c_ends_a_run_in_order() {
    let (trace, recording) = (fresh("ended.log"), fresh("ended.rec"));
    let trace_word = format!("--trace {}", trace.display());
    let machine = format!(
        "run --app cruise --mode deterministic --jobs 100000 --append trace_events=2000 --input \
         apps/cruise/gaps.txt --record {} {trace_word}",
        recording.display()
    );
    let linux = format!("run --app fork-join --on linux --cores 1 --jobs 5000 {trace_word}");
    for words in [&machine, &linux] {
        let (child, said) = start(words, "\"kind\":\"boot\"");
        EndSignals::send(child.id());
        let (text, code) = end(child, said);
        assert_eq!(code, BY_PERSON, "{words}: {text}");
        let transcript = Transcript::read(&text);
        assert!(transcript.of_kind("dag_status").count() > 0, "{text}");
        let verdict = transcript.of_kind("verdict").next();
        let status = verdict.and_then(|line| line.text_at("status"));
        assert_eq!(status, Some("success"), "{text}");
        assert!(
            text.contains("\nended by ctrl-C, in order, after "),
            "{text}"
        );
        assert_eq!(closings(&trace), transcript.of_kind("dag_status").count());
    }
    let words = format!("recording {}", recording.display());
    let output = tool(&words).output().expect("the tool can be started");
    assert!(output.status.success(), "{output:?}");
}

#[test]
fn so_does_the_timeout_which_is_a_failure() {
    let trace = fresh("timed-out.log");
    for on in [
        "--mode deterministic --jobs 100000 --append trace_events=2000",
        "--on linux --jobs 5000",
    ] {
        let words = format!(
            "run --app fork-join --cores 1 --longest 1 --timeout 3 {on} --trace {}",
            trace.display()
        );
        let output = tool(&words).output().expect("the tool can be started");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{on}: {said}");
        assert!(
            said.contains("no end within 3 s, so it was ended in order; "),
            "{said}"
        );
        assert!(closings(&trace) > 0, "{on}");
    }
}

#[test]
fn the_second_ctrl_c_kills() {
    // The first one is heard, and what is in flight takes long.
    let file = fresh("endless.dag");
    let dag = "dag d period 1000s\nsubtask a wcet 500s\nend\n";
    fs::write(&file, dag).expect("the tests' folder takes a file");
    let words = format!(
        "run --dag {} --mode deterministic --cores 1 --jobs 2 --occupy spin --timeout 500",
        file.display()
    );
    let (mut child, said) = start(&words, "\"kind\":\"boot\"");
    let mut complaints = BufReader::new(child.stderr.take().expect("it is a pipe"));
    EndSignals::send(child.id());
    let mut line = String::new();
    while !line.contains("ctrl-C again") {
        line.clear();
        assert!(
            complaints.read_line(&mut line).expect("UTF-8") > 0,
            "it says nothing"
        );
    }
    EndSignals::send(child.id());
    let (text, code) = end(child, said);
    assert_eq!(code, BY_PERSON, "{text}");
    let mut rest = String::new();
    complaints.read_to_string(&mut rest).expect("UTF-8");
    assert!(
        rest.contains("ctrl-C was pressed again, and QEMU was killed"),
        "{rest}"
    );
}
