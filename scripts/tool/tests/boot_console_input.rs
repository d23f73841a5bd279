//! `run --console` as a program uses it: with a pipe as standard input, which ends.

use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use tool::image;

/// Runs an app for so many jobs, with this on standard input, which then ends. Returns
/// the exit code and the output.
fn run(input: &str, jobs: u64) -> (Option<i32>, String) {
    let image = image::build("fork-join").expect("it builds").path;
    let mut command = Command::new(env!("CARGO_BIN_EXE_fass-tool"));
    command.args(["run", "--console", "--json", "--mode=deterministic"]);
    command
        .args(["--timeout=60", "--jobs"])
        .arg(jobs.to_string());
    command.arg("--image").arg(image);
    command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut child = command.spawn().expect("the tool can be started");
    let mut way = child.stdin.take().expect("a pipe");
    way.write_all(input.as_bytes()).expect("the tool reads it");
    drop(way);
    let output = child.wait_with_output().expect("it ends");
    let said = [output.stdout, output.stderr].concat();
    (
        output.status.code(),
        String::from_utf8_lossy(&said).into_owned(),
    )
}

#[test]
fn the_last_line_needs_no_end() {
    let (code, said) = run("stats\nshutdown", 500);
    assert_eq!(code, Some(0), "{said}");
    assert!(
        said.contains("\"command\":\"stats\",\"accepted\":true"),
        "{said}"
    );
    assert_eq!(
        said.matches("\"command\":\"shutdown\"").count(),
        1,
        "{said}"
    );
}

#[test]
fn a_run_without_end_ends_with_its_input() {
    let (code, said) = run("", 0);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("\"command\":\"shutdown\""), "{said}");
}

#[test]
fn of_many_lines_at_once_whole_answers_are_left_out() {
    let (code, said) = run(&"stats\n".repeat(300), 0);
    // A damaged machine line would be a failure.
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("\"command\":\"stats\""), "{said}");
}

#[test]
fn a_wire_takes_standard_input() {
    let image = image::build("cruise").expect("it builds").path;
    let file = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("speeds");
    let mut command = Command::new(env!("CARGO_BIN_EXE_fass-tool"));
    // Whenever the line comes, there is a time for it.
    command.args(["run", "--mode=threads", "--jobs=300", "--input=-"]);
    command
        .args(["--append=budget_factor=0", "--output"])
        .arg(&file);
    command.arg("--image").arg(image);
    command.stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut child = command.spawn().expect("the tool can be started");
    let mut way = child.stdin.take().expect("a pipe");
    way.write_all(b"gap 2350\ngap x\n")
        .expect("the tool reads it");
    drop(way);
    let output = child.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}");
    assert!(
        said.contains("2 packets came, 0 were lost, 1 malformed"),
        "{said}"
    );
    let sent = fs::read_to_string(&file).expect("it was written");
    assert_eq!(sent.lines().count(), 300, "{sent}");
    assert!(
        sent.contains("\nspeed 35\n") || sent.starts_with("speed 35\n"),
        "{sent}"
    );
}

#[test]
fn a_wrong_file_of_bytes_and_an_app_without_a_wire_are_refused() {
    let file = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("bytes.txt");
    let refused = |app: &str, text: &str, says: &str| {
        fs::write(&file, text).expect("the tests' folder takes one");
        let mut run = Command::new(env!("CARGO_BIN_EXE_fass-tool"));
        run.args(["run", "--mode=deterministic", "--app", app, "--input"]);
        let output = run.arg(&file).output().expect("the tool starts");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(says), "{said}");
    };
    let wrong = "bytes.txt:2: `6g` is no pair of hexadecimal digits; write bytes such as 0a";
    refused("cruise", "1ms \"gap 1\\n\"\n2ms 6g\n", wrong);
    refused(
        "cruise",
        "# none\n",
        "bytes.txt`: it has no bytes; write lines such as 4ms",
    );
    refused("fork-join", "1ms 0a\n", "`input` is no option");
}

#[test]
fn a_run_whose_output_goes_to_a_program_is_not_asked_for_its_status() {
    let mut run = Command::new(env!("CARGO_BIN_EXE_fass-tool"));
    let words = [
        "run",
        "--mode",
        "deterministic",
        "--jobs",
        "2",
        "--subtasks",
        "2",
    ];
    let output = run.args(words).output().expect("the tool starts");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}");
    let words = said.lines().find(|line| line.contains("guest words: "));
    assert!(
        words.is_some_and(|line| !line.contains("status=")),
        "{said}"
    );
}
