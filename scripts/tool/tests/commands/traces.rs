//! `check-trace` and `trace`: what they print, and their exit codes.

use std::fs;
use std::path::PathBuf;

use tool::protocol::{MachineLine, read_line};

use crate::support::{assert_refused, call, folder, succeed};

pub(crate) const GOOD: &str = r#"the guest says hello
{"kind":"trace_begin","policy":"edf","preemption":"on","cores":1,"run":0}
{"kind":"trace_dag","dag":0,"name":"x","period_ns":10000000,"relative_deadline_ns":10000000,"offset_ns":0,"in_flight":1,"overrun":"queue","subtasks":[["a",0,0,null]],"edges":[]}
{"kind":"trace","events":[[5,"released",0,0,0,-1],[6,"ready",0,0,0,0],[9,"start",0,0,0,0]]}
{"kind":"trace","events":[[2000000,"finish",0,0,0,0],[2000001,"completed",0,0,0,-1]]}
{"kind":"trace_end","events":5,"lost":0}
"#;

/// A folder with a good trace, and others.
fn traces(name: &str, others: &[(&str, &str)]) -> PathBuf {
    let folder = folder(name);
    for (name, text) in [("good.log", GOOD)].iter().chain(others) {
        fs::write(folder.join(name), text).expect("the test's folder takes a file");
    }
    folder
}

/// Returns the machine line of a kind.
fn machine_line(said: &str, kind: &str) -> MachineLine {
    let mut lines = said.lines().filter_map(|line| read_line(1, line));
    let line = lines.find(|line| line.as_ref().is_ok_and(|line| line.kind == kind));
    line.expect(said).expect("it is well formed")
}

#[test]
fn a_good_trace_is_0_and_said_in_a_table_and_a_machine_line() {
    let folder = traces("good", &[]);
    let said = succeed(&folder, "check-trace good.log");
    assert!(said.contains("breaches                        0"), "{said}");
    let machine = machine_line(&said, "trace_check");
    assert_eq!(machine.number_at("events"), Some(5));
    assert_eq!(machine.number_at("ready_to_start_ns.max"), Some(3));
    // With --json nothing else is on standard output.
    let said = succeed(&folder, "check-trace --json good.log");
    assert_eq!(said.lines().count(), 1);
}

#[test]
fn a_breach_is_1_and_the_bound_decides() {
    let late = GOOD.replace("[9,\"start\"", "[1500000,\"start\"");
    let folder = traces("late", &[("late.log", &late)]);
    let called = call(&folder, ["check-trace", "late.log"]);
    assert_eq!(called.code, Some(1));
    let breach = "  breach at 6 ns, R5 dispatch: subtask `a` of dag `x` job 0 should run and waits \
                  1499994 ns while core 0 is idle";
    let said = called.out;
    assert!(said.lines().any(|line| line == breach), "{said}");
    succeed(&folder, "check-trace --bound-us 1500 late.log");
}

/// All files are read before the first run is judged. What is wrong with a line is told by the
/// reader's own tests.
#[test]
fn a_file_without_a_trace_or_with_a_damaged_one_is_2() {
    let lines: Vec<&str> = GOOD.lines().collect();
    let others = [
        ("none.log", "hello\nbye\n"),
        ("nothing.log", ""),
        (
            "empty.log",
            &format!(
                "{}\n{}",
                lines[1], r#"{"kind":"trace_end","events":0,"lost":0}"#
            ),
        ),
        ("strange.log", &GOOD.replace("\"start\"", "\"go\"")),
    ];
    let folder = traces("damaged", &others);
    let rows = "
check-trace good.log none.log | check-trace: none.log:2: the file ends without a trace; `./scripts/run --trace FILE` makes one
check-trace good.log nothing.log | check-trace: nothing.log:1: the file ends without a trace; `./scripts/run --trace FILE` makes one
check-trace good.log empty.log | check-trace: empty.log:1: no run of the file has an event
check-trace good.log strange.log | check-trace: strange.log:4: `trace`: event 3 of the line: `go` is no event
check-trace | which files? name at least one serial log with a trace
check-trace none | none: cannot be read
check-trace --bound-us x y | `--bound-us x`: must be a number
trace | which file
trace none | none: cannot be read
trace good.log -o none/file | `--out none/file`
trace good.log --run 3 | has no such run; its runs are 0";
    assert_refused(&folder, rows);
}

#[test]
fn a_trace_is_drawn_to_a_file_or_to_standard_output() {
    let folder = traces("drawn", &[]);
    let drawn = succeed(&folder, "trace good.log");
    let value = tool::json::parse(&drawn).expect("JSON");
    let events = value.get("traceEvents").expect("events");
    assert!(events.elements().len() > 10, "{drawn}");
    let called = call(&folder, ["trace", "good.log", "-o", "out.json"]);
    let hint = "out.json: open it at https://ui.perfetto.dev\n";
    assert_eq!((called.code, called.complaint.as_str()), (Some(0), hint));
    let written = fs::read_to_string(folder.join("out.json"));
    assert_eq!(written.expect("written"), drawn);
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
    let folder = traces("chain", &[("chain.log", CHAIN)]);
    let said = succeed(&folder, "check-trace chain.log");
    // Ages 55, 90, 132 and 70; data ages 90, 132 and 170; the reaction to what is seen just after 0
    // is the output of 170.
    let chain = "
  chain eye/look > arm/move
    age of an output              median 0.070 us, p99 0.132 us, max 0.132 us of 4 (bound 0.150 us)
    data age                      median 0.132 us, p99 0.170 us, max 0.170 us of 3 (bound 0.190 us)
    reaction time                 median 0.170 us, p99 0.170 us, max 0.170 us of 1 (bound 0.190 us)
";
    assert!(said.contains(chain), "{said}");
    let of_chain = "check-trace --json chain.log --from eye/look --to arm/move";
    let line = machine_line(&succeed(&folder, of_chain), "chain");
    assert_eq!(line.number_at("reaction_ns.max"), Some(170));
    assert_eq!(line.number_at("reaction_bound_ns"), Some(190));
    let rows = "
check-trace chain.log --from eye/lok --to arm/move | did you mean `eye/look`?
check-trace chain.log --from arm/move --to eye/look | no edges and samples lead from `arm/move`";
    assert_refused(&folder, rows);
}
