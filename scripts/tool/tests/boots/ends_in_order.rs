//! Ctrl-C, and the timeout, end a run in order: by real signals, on the machine in QEMU and on
//! Linux. The counts, the recording and the trace are there and whole; the second ctrl-C kills.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Stdio};

use end_signals::EndSignals;
use sched_dag::journal::EventKind;
use tool::system::workspace;
use views::protocol::Transcript;
use views::record::Record;

use crate::support::{call, command, folder, succeed};

/// The exit code after ctrl-C.
const BY_PERSON: Option<i32> = Some(130);

/// Reads lines up to the first that contains a text.
fn await_line(said: &mut impl BufRead, awaited: &str) {
    let mut line = String::new();
    while !line.contains(awaited) {
        line.clear();
        let bytes = said.read_line(&mut line).expect("UTF-8");
        assert!(bytes > 0, "it ended before `{awaited}`");
    }
}

/// Starts a run, and returns it with its output up to the end of its boot.
fn start(folder: &Path, line: &str) -> (Child, BufReader<impl Read>) {
    let mut command = command(folder, line.split(' '));
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the tool can be started");
    let mut said = BufReader::new(child.stdout.take().expect("it is a pipe"));
    await_line(&mut said, "\"kind\":\"boot\"");
    (child, said)
}

/// Waits for the end; returns the rest of standard output, and the exit code.
fn end(mut child: Child, mut said: BufReader<impl Read>) -> (String, Option<i32>) {
    let mut text = String::new();
    said.read_to_string(&mut text).expect("UTF-8");
    let status = child.wait().expect("it is ours");
    (text, status.code())
}

/// Makes sure that the trace in a folder breaks no rule; returns the number of events that close a
/// DAG.
fn closings(folder: &Path) -> usize {
    succeed(folder, "check-trace --bound-us 5000000 trace.rec");
    let bytes = fs::read(folder.join("trace.rec")).expect("it is there");
    let record = Record::read(&bytes).expect("it is whole");
    let events = record.runs.iter().flat_map(|run| &run.events);
    events
        .filter(|event| event.what == EventKind::Closed)
        .count()
}

#[test]
fn the_first_ctrl_c_ends_a_run_in_order() {
    let folder = folder("ended");
    let gaps = workspace().join("apps/cruise/gaps.txt");
    let machine = format!(
        "run --app cruise --mode deterministic --jobs 100000 --append trace_events=2000 --input {} \
         --keep ended.rec --trace trace.rec",
        gaps.display()
    );
    let linux = "run --app fork-join --on linux --cores 1 --jobs 5000 --trace trace.rec";
    for line in [&machine, linux] {
        let (child, said) = start(&folder, line);
        EndSignals::send(child.id());
        let (text, code) = end(child, said);
        assert_eq!(code, BY_PERSON, "{line}: {text}");
        let transcript = Transcript::read(&text);
        assert!(transcript.of_kind("dag_status").count() > 0, "{text}");
        let verdict = transcript.of_kind("verdict").next();
        let status = verdict.and_then(|line| line.text_at("status"));
        assert_eq!(status, Some("success"), "{text}");
        let words = "\nended by ctrl-C, in order, after ";
        assert!(text.contains(words), "{text}");
        assert_eq!(closings(&folder), transcript.of_kind("dag_status").count());
    }
    succeed(&folder, "recording ended.rec");
}

#[test]
fn so_does_the_timeout_which_is_a_failure() {
    let folder = folder("timed-out");
    for on in [
        "--mode deterministic --jobs 100000 --append trace_events=2000",
        "--on linux --jobs 5000",
    ] {
        let run = "run --app fork-join --cores 1 --longest 1 --timeout 3 --trace trace.rec";
        let called = call(&folder, format!("{run} {on}").split(' '));
        let said = called.complaint;
        assert_eq!(called.code, Some(1), "{on}: {said}");
        let words = "no end within 3 s, so it was ended in order; ";
        assert!(said.contains(words), "{said}");
        assert!(closings(&folder) > 0, "{on}");
    }
}

#[test]
fn a_long_judgement_is_told_of_after_the_counts() {
    let folder = folder("judged");
    let dag = "dag d period 50us\nsubtask a wcet 1us\nend\n";
    fs::write(folder.join("d.dag"), dag).expect("the tests' folder takes a file");
    // After 20,000 jobs of five events.
    let run = "run --dag d.dag --mode deterministic --cores 1 --jobs 300000 --append status=1";
    let (child, mut said) = start(&folder, run);
    await_line(&mut said, "\"kind\":\"status\"");
    EndSignals::send(child.id());
    let (text, code) = end(child, said);
    assert_eq!(code, BY_PERSON, "{text}");
    let places = ["dag_status", "judging the run: 65536 events so far"].map(|it| text.find(it));
    assert!(places[0].is_some() && places[0] < places[1], "{text}");
}

#[test]
fn the_second_ctrl_c_kills() {
    // The first ctrl-C is received, and the jobs in flight take long.
    let folder = folder("endless");
    let dag = "dag d period 1000s\nsubtask a wcet 500s\nend\n";
    fs::write(folder.join("endless.dag"), dag).expect("the tests' folder takes a file");
    let run = "run --dag endless.dag --mode deterministic --cores 1 --jobs 2 --occupy spin \
               --timeout 500";
    let (mut child, said) = start(&folder, run);
    let mut complaints = BufReader::new(child.stderr.take().expect("it is a pipe"));
    EndSignals::send(child.id());
    await_line(&mut complaints, "ctrl-C again");
    EndSignals::send(child.id());
    let (text, code) = end(child, said);
    assert_eq!(code, BY_PERSON, "{text}");
    await_line(
        &mut complaints,
        "ctrl-C was pressed again, and QEMU was killed",
    );
}
