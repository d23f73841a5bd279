//! `check-trace` and `trace` as a person calls them: what they print, and their exit
//! codes.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use tool::protocol::read_line;

const GOOD: &str = r#"the guest says hello
{"kind":"trace_begin","policy":"edf","preemption":"on","cores":1,"run":0}
{"kind":"trace_dag","dag":0,"name":"x","period_ns":10000000,"relative_deadline_ns":10000000,"offset_ns":0,"in_flight":1,"overrun":"queue","subtasks":[["a",0,0,null]],"edges":[]}
{"kind":"trace","events":[[5,"released",0,0,0,-1],[6,"ready",0,0,0,0],[9,"start",0,0,0,0]]}
{"kind":"trace","events":[[2000000,"finish",0,0,0,0],[2000001,"completed",0,0,0,-1]]}
{"kind":"trace_end","events":5,"lost":0}
"#;

/// Writes a file of this test's own.
fn file(name: &str, text: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::write(&path, text).expect("the test's folder takes a file");
    path
}

fn check_trace(words: &[&str]) -> Output {
    call("check-trace", words)
}

fn call(subcommand: &str, words: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fass-tool"));
    command.arg(subcommand).args(words);
    command.output().expect("the tool can be started")
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("UTF-8")
}

#[test]
fn a_good_trace_is_0_and_said_in_a_table_and_a_machine_line() {
    let path = file("good.log", GOOD);
    let output = check_trace(&[path.to_str().unwrap()]);
    let said = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains("breaches                        0"), "{said}");
    let machine = said.lines().find_map(|line| read_line(1, line));
    let machine = machine.expect("a machine line").expect("well formed");
    assert_eq!(machine.kind, "trace_check");
    assert_eq!(machine.number_at("events"), Some(5));
    assert_eq!(machine.number_at("ready_to_start_ns.max"), Some(3));
    // With --json nothing else is on standard output.
    let output = check_trace(&["--json", path.to_str().unwrap()]);
    assert_eq!(text(&output.stdout).lines().count(), 1);
}

#[test]
fn a_breach_is_1_and_the_bound_decides() {
    let late = GOOD.replace("[9,\"start\"", "[1500000,\"start\"");
    let path = file("late.log", &late);
    let path = path.to_str().unwrap();
    let output = check_trace(&[path]);
    assert_eq!(output.status.code(), Some(1));
    let said = text(&output.stdout);
    let breach = "  breach at 6 ns, R5 dispatch: subtask `a` of dag `x` job 0 should run and waits \
                  1499994 ns while core 0 is idle";
    assert!(said.lines().any(|line| line == breach), "{said}");
    let output = check_trace(&["--bound-us", "1500", path]);
    assert_eq!(output.status.code(), Some(0));
}

#[test]
fn a_file_without_a_trace_or_with_a_damaged_one_is_2() {
    let good = file("another.log", GOOD);
    let refused = |name: &str, text_of: &str, said: &str| {
        let path = file(name, text_of);
        let output = check_trace(&[good.to_str().unwrap(), path.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(2));
        let expected = format!("check-trace: {}:{said}\n", path.display());
        assert_eq!(text(&output.stderr), expected);
        assert!(output.stdout.is_empty());
    };
    let no_trace = "2: the file ends without a trace; `./scripts/run --trace FILE` makes one";
    refused("none.log", "hello\nbye\n", no_trace);
    let lines: Vec<&str> = GOOD.lines().collect();
    let ends = "1: the file ends without a trace; `./scripts/run --trace FILE` makes one";
    refused("nothing.log", "", ends);
    let many = GOOD.replace("\"cores\":1", "\"cores\":10000000");
    let most = "2: `trace_begin`: `cores` is 10000000 and must be from 1 to 64";
    refused("many.log", &many, most);
    let no_event = format!(
        "{}\n{}\n",
        lines[1],
        lines[5].replace("\"events\":5", "\"events\":0")
    );
    refused("empty.log", &no_event, "1: no run of the file has an event");
    let strange = GOOD.replace("\"start\"", "\"go\"");
    refused(
        "strange.log",
        &strange,
        "4: `trace`: event 3 of the line: `go` is no event",
    );
    assert_eq!(check_trace(&[]).status.code(), Some(2));
    assert_eq!(check_trace(&["/no/such/file"]).status.code(), Some(2));
    assert_eq!(
        check_trace(&["--bound-us", "x", "y"]).status.code(),
        Some(2)
    );
}

#[test]
fn a_trace_is_drawn_to_a_file_or_to_standard_output() {
    let log = file("drawn.log", GOOD);
    let log = log.to_str().unwrap();
    let output = call("trace", &[log]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let drawn = text(&output.stdout);
    let value = tool::json::parse(drawn).expect("JSON");
    assert!(
        value
            .get("traceEvents")
            .is_some_and(|events| events.elements().len() > 10)
    );
    let out = file("drawn.json", "");
    let output = call("trace", &[log, "-o", out.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(fs::read_to_string(&out).expect("written"), drawn);
    let hint = format!("{}: open it at https://ui.perfetto.dev\n", out.display());
    assert_eq!(text(&output.stderr), hint);
    let refused = |words: &[&str]| {
        let output = call("trace", words);
        (output.status.code(), text(&output.stderr).to_string())
    };
    let (code, said) = refused(&[log, "--run", "3"]);
    assert_eq!(code, Some(2));
    assert!(
        said.ends_with("has no such run; its runs are 0\n"),
        "{said}"
    );
    assert_eq!(refused(&[]).0, Some(2));
    assert_eq!(refused(&["/no/such/file"]).0, Some(2));
    assert_eq!(refused(&[log, "-o", "/no/such/folder/file"]).0, Some(2));
}

#[test]
fn that_no_one_reads_the_output_is_no_failure() {
    let log = file("unread.log", GOOD);
    for subcommand in ["trace", "check-trace"] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_fass-tool"));
        command.arg(subcommand).arg(&log).stdout(Stdio::piped());
        let mut child = command.spawn().expect("the tool can be started");
        drop(child.stdout.take());
        let status = child.wait().expect("it ends");
        assert_eq!(status.code(), Some(0), "{subcommand}");
    }
}

/// `eye`, of period 100, is sampled by `arm`, of period 40. The eye's value of 0 is there at 20;
/// the arm's outputs of 10 find nothing, those of 55, 90 and 132 go back to 0, that of 170 to 100.
const CHAIN: &str = r#"
{"kind":"graph","commit":0,"policy":"edf","preemption":"on","cores":2,"overhead_ns":[],"period_ns":1,"relative_deadline_ns":1,"offset_ns":0,"in_flight":1,"overrun":"queue","subtasks":[],"edges":[],"hash":1,"sporadic":false,"jobs":[],"states":[],"dag":0,"name":"eye","bound_ns":[30],"topics":[["seen","u8",0,[],1]],"samples":[]}
{"kind":"graph","commit":0,"policy":"edf","preemption":"on","cores":2,"overhead_ns":[],"period_ns":1,"relative_deadline_ns":1,"offset_ns":0,"in_flight":1,"overrun":"queue","subtasks":[],"edges":[],"hash":1,"sporadic":false,"jobs":[],"states":[],"dag":1,"name":"arm","bound_ns":[20],"topics":[],"samples":[[0,0,0,130]]}
{"kind":"trace_begin","policy":"edf","preemption":"on","cores":2,"run":0}
{"kind":"trace_dag","dag":0,"name":"eye","period_ns":100,"relative_deadline_ns":100,"offset_ns":0,"in_flight":1,"overrun":"queue","subtasks":[["look",0,0,null]],"edges":[]}
{"kind":"trace_dag","dag":1,"name":"arm","period_ns":40,"relative_deadline_ns":40,"offset_ns":0,"in_flight":1,"overrun":"queue","subtasks":[["move",0,0,null]],"edges":[]}
{"kind":"trace","events":[[0,"released",0,0,0,-1],[0,"released",0,1,0,-1],[0,"ready",0,0,0,0],[0,"ready",0,1,0,0],[1,"start",0,0,0,0],[1,"start",1,1,0,0],[10,"finish",1,1,0,0],[10,"completed",1,1,0,-1],[20,"finish",0,0,0,0],[20,"completed",0,0,0,-1]]}
{"kind":"trace","events":[[40,"released",0,1,1,-1],[40,"ready",0,1,1,0],[41,"start",0,1,1,0],[55,"finish",0,1,1,0],[55,"completed",0,1,1,-1],[80,"released",0,1,2,-1],[80,"ready",0,1,2,0],[81,"start",0,1,2,0],[90,"finish",0,1,2,0],[90,"completed",0,1,2,-1]]}
{"kind":"trace","events":[[100,"released",0,0,1,-1],[100,"ready",0,0,1,0],[101,"start",0,0,1,0],[120,"released",0,1,3,-1],[120,"ready",0,1,3,0],[121,"start",1,1,3,0],[125,"finish",0,0,1,0],[125,"completed",0,0,1,-1],[132,"finish",1,1,3,0],[132,"completed",1,1,3,-1]]}
{"kind":"trace","events":[[160,"released",0,1,4,-1],[160,"ready",0,1,4,0],[161,"start",0,1,4,0],[170,"finish",0,1,4,0],[170,"completed",0,1,4,-1]]}
{"kind":"trace_end","events":35,"lost":0}
"#;

#[test]
fn a_chain_across_dags_has_the_times_that_a_person_computes() {
    let path = file("chain.log", CHAIN);
    let path = path.to_str().unwrap();
    let output = check_trace(&[path]);
    let said = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{said}");
    for line in [
        "  chain eye/look > arm/move",
        // Ages 55, 90, 132 and 70; data ages 90, 132 and 170; the reaction to what is seen just
        // after 0 is the output of 170.
        "    age of an output              median 0.070 us, p99 0.132 us, max 0.132 us of 4 (bound 0.150 us)",
        "    data age                      median 0.132 us, p99 0.170 us, max 0.170 us of 3 (bound 0.190 us)",
        "    reaction time                 median 0.170 us, p99 0.170 us, max 0.170 us of 1 (bound 0.190 us)",
    ] {
        assert!(said.lines().any(|found| found == line), "{line}\n{said}");
    }
    let json = check_trace(&["--json", path, "--from", "eye/look", "--to", "arm/move"]);
    let line = text(&json.stdout).lines().nth(1).expect("a second line");
    let line = read_line(1, line)
        .expect("a machine line")
        .expect("well formed");
    assert_eq!(line.kind, "chain");
    assert_eq!(line.number_at("reaction_ns.max"), Some(170));
    assert_eq!(line.number_at("reaction_bound_ns"), Some(190));
}

#[test]
fn a_chain_that_is_not_there_is_refused_with_a_hint() {
    let path = file("no-chain.log", CHAIN);
    let path = path.to_str().unwrap();
    for (words, told) in [
        (
            ["--from", "eye/lok", "--to", "arm/move"],
            "did you mean `eye/look`?",
        ),
        (
            ["--from", "arm/move", "--to", "eye/look"],
            "no edges and samples lead from `arm/move`",
        ),
    ] {
        let output = check_trace(&[&[path], &words[..]].concat());
        assert_eq!(output.status.code(), Some(2));
        let said = text(&output.stderr);
        assert!(said.contains(told), "{said}");
    }
}
