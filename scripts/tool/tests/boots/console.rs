//! Input of a run: a console and a wire on a pipe as standard input, which ends, and files of
//! bytes.

use std::fs;
use std::io::Write;
use std::process::Stdio;

use tool::system::workspace;

use crate::support::{Called, assert_refused, command, folder, succeed};

/// Calls the tool with this on standard input, which then ends.
fn feed(line: &str, input: &str) -> Called {
    let mut command = command(workspace(), line.split(' '));
    command.stdin(Stdio::piped());
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the tool can be started");
    let mut way = child.stdin.take().expect("a pipe");
    way.write_all(input.as_bytes()).expect("the tool reads it");
    drop(way);
    Called::of(child.wait_with_output().expect("it ends"))
}

/// Runs with a console end well for each input, and their standard output has a text as often as
/// given. A run of 0 jobs ends with its input.
#[test]
fn a_console_hears_a_pipe_to_its_end() {
    for (input, jobs, words, count) in [
        // The last line needs no end.
        (
            "stats\nshutdown",
            500,
            "\"command\":\"stats\",\"accepted\":true",
            1..=1,
        ),
        ("stats\nshutdown", 500, "\"command\":\"shutdown\"", 1..=1),
        ("", 0, "\"command\":\"shutdown\"", 1..=1),
        // Of many at once whole answers are left out; a damaged machine line would be a failure.
        (&"stats\n".repeat(300), 0, "\"command\":\"stats\"", 1..=300),
    ] {
        let run = "run --console --json --mode=deterministic --timeout=60 --jobs";
        let called = feed(&format!("{run} {jobs}"), input);
        let said = called.out + &called.complaint;
        assert_eq!(called.code, Some(0), "{said}");
        assert!(count.contains(&said.matches(words).count()), "{said}");
    }
}

#[test]
fn a_wire_takes_standard_input() {
    let file = folder("speeds").join("speeds");
    // There is a time for the line, whenever it comes.
    let run = "run --app cruise --mode=threads --jobs=300 --input=- --append=budget_factor=0";
    let line = format!("{run} --output {}", file.display());
    let called = feed(&line, "gap 2350\ngap x\n");
    let said = called.out;
    assert_eq!(called.code, Some(0), "{said}");
    let counted = "2 packets came, 0 were lost, 1 malformed";
    assert!(said.contains(counted), "{said}");
    let sent = fs::read_to_string(&file).expect("it was written");
    assert_eq!(sent.lines().count(), 300, "{sent}");
    assert!(sent.lines().any(|line| line == "speed 35"), "{sent}");
}

#[test]
fn a_wrong_file_of_bytes_and_an_app_without_a_wire_are_refused() {
    let folder = folder("wires");
    for (name, bytes) in [
        ("wrong", "1ms \"gap 1\\n\"\n2ms 6g\n"),
        ("none", "# none\n"),
        ("good", "1ms 0a\n"),
    ] {
        fs::write(folder.join(name), bytes).expect("the tests' folder takes one");
    }
    let rows = "
run --mode=deterministic --app cruise --input wrong | wrong:2: `6g` is no pair of hexadecimal digits; write bytes such as 0a
run --mode=deterministic --app cruise --input none | none`: it has no bytes; write lines such as 4ms";
    assert_refused(&folder, rows);
    let run = "run --mode=deterministic --app fork-join --input good";
    let called = Called::of(
        command(&folder, run.split(' '))
            .output()
            .expect("it starts"),
    );
    assert_eq!(called.code, Some(2), "{}", called.complaint);
    let words = "`input` is no option";
    assert!(called.complaint.contains(words), "{}", called.complaint);
}

#[test]
fn a_run_whose_output_goes_to_a_program_is_not_asked_for_its_status() {
    let said = succeed(
        workspace(),
        "run --mode deterministic --jobs 2 --subtasks 2",
    );
    let words = said.lines().find(|line| line.contains("guest words: "));
    let is_told = words.is_some_and(|line| !line.contains("status="));
    assert!(is_told, "{said}");
}
