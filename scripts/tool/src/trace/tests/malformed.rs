//! Logs that are not as the protocol says are refused with their line.

use super::super::read;

const GOOD: &str = r#"hello
{"kind":"trace_begin","policy":"edf","preemption":"off","cores":2,"run":3}
{"kind":"trace_dag","dag":0,"name":"x","period_ns":10,"relative_deadline_ns":10,"offset_ns":0,"in_flight":1,"overrun":"skip","subtasks":[["a",0,0,null],["b",1,1,7]],"edges":[[0,1]]}
{"kind":"progress","done":1,"total":2}
{"kind":"trace","events":[[0,"released",0,0,0,-1],[1,"start",0,0,0,1]]}
{"kind":"trace","events":[[0,"ready",1,0,0,0]]}
{"kind":"trace_end","events":3,"lost":0}
bye
"#;

#[test]
fn a_good_log_is_read() {
    let runs = read(GOOD).unwrap();
    assert_eq!(runs.len(), 1);
    let run = &runs[0];
    assert_eq!((run.number, run.line, run.options.cores), (3, 2, 2));
    assert_eq!((run.events.len(), run.task_set.dags().len()), (3, 1));
    assert!(run.task_set.dags()[0].subtasks()[1].is_non_preemptive());
    assert_eq!(read("hello\n").unwrap().len(), 0);
    let second = GOOD.replace("\"run\":3", "\"run\":4");
    assert_eq!(read(&format!("{GOOD}{second}")).unwrap().len(), 2);
}

/// What stands in the good log, what is put in its place, and the line and the reason of the refusal.
const WRONG: &str = r#""edf" | "rr" | 2 | `trace_begin`: `policy` is `rr` and must be static or edf
"off" | "no" | 2 | `trace_begin`: `preemption` is `no` and must be on or off
"cores":2 | "cores":0 | 2 | `trace_begin`: `cores` is 0 and must be from 1 to 64
"cores":2 | "cores":4294967295 | 2 | `trace_begin`: `cores` is 4294967295 and must be from 1 to 64
"period_ns":10, | "period_ns":0, | 3 | `trace_dag`: `period_ns` is 0 and must be at least 1
"relative_deadline_ns":10, | "relative_deadline_ns":0, | 3 | `trace_dag`: `relative_deadline_ns` is 0 and must be at least 1
"in_flight":1 | "in_flight":0 | 3 | `trace_dag`: `in_flight` is 0 and must be from 1 to 4294967295
"overrun":"skip" | "overrun":"skip","sporadic":"true" | 3 | `trace_dag`: `sporadic` is neither true nor false
"lost":0 | "lost":0,"complete":"yes" | 7 | `trace_end`: `complete` is neither true nor false
"dag":0, | "dag":1, | 3 | `trace_dag`: dag 1 stands where dag 0 belongs
"skip" | "hop" | 3 | `trace_dag`: `overrun` is `hop` and must be queue, skip or abort
["a",0,0,null] | ["a",0,2,null] | 3 | `trace_dag`: a subtask is [name, priority, non-preemptive 0 or 1, WCET or null]
[[0,1]] | [[0,2]] | 3 | `trace_dag`: an edge is a pair of numbers less than 2, the number of subtasks
"period_ns":10 | "period_ns":-1 | 3 | `trace_dag`: `period_ns` is not a number from 0
"start" | "begin" | 5 | `trace`: event 2 of the line: `begin` is no event
[0,"released",0,0,0,-1] | [0,"released",0,0,0,1] | 5 | `trace`: event 1 of the line: `released` is of a job, and its subtask not -1
[0,"ready",1,0,0,0] | [0,"ready",2,0,0,0] | 6 | `trace`: event 1 of the line: its core is not a number less than 2
[0,"ready",1,0,0,0] | [0,"ready",1,0,0,2] | 6 | `trace`: event 1 of the line: its subtask is not a number less than 2
[0,"ready",1,0,0,0] | [0,"ready",1] | 6 | `trace`: event 1 of the line: it is not [time, event, core, dag, job, subtask]
"events":3 | "events":4 | 7 | `trace_end`: 4 events are announced, 3 are there
[1,"start",0,0,0,1] | [1,"start",0,0,0,1],[0,"finish",0,0,0,1],[1,"released",0,0,1,-1] | 7 | `trace_end`: 3 events are announced, 5 are there
"lost":0 | "lose":0 | 7 | a line of kind `trace_end` without `lost`
bye | {"kind":"trace","events":[]} | 8 | `trace`: no `trace_begin` comes before it
{"kind":"trace_end","events":3,"lost":0} |  | 2 | this trace has no `trace_end`; was the guest killed?
{"kind":"progress","done":1,"total":2} | {"kind":"trace_begin","policy":"edf","preemption":"off","cores":2,"run":4} | 4 | `trace_begin`: the trace of line 2 has not ended yet
{"kind":"progress","done":1,"total":2} | {"kind":"progress","do | 4 | column 23: the line ends where the closing `"` must stand
[0,"released",0,0,0,-1] | [2,"released",0,0,0,-1] | 7 | `trace_end`: time goes back in the events of core 0; each core's must be in the order of time"#;

#[test]
fn whatever_is_wrong_is_named_with_its_line() {
    for row in WRONG.lines() {
        let [from, to, line, reason] = row.split(" | ").collect::<Vec<_>>()[..] else {
            panic!("{row}");
        };
        assert_eq!(GOOD.matches(from).count(), 1, "{from}");
        let fault = read(&GOOD.replace(from, to)).expect_err(reason);
        let found = (fault.line.to_string(), fault.reason.as_str());
        assert_eq!(found, (line.into(), reason));
    }
}

#[test]
fn a_graph_that_no_commit_takes_is_refused_as_there() {
    let fault = read(&GOOD.replace("[[0,1]]", "[[0,1],[1,0]]")).unwrap_err();
    assert_eq!(fault.line, 3);
    for part in [
        "`trace_dag`: dag `x` ",
        "; dag `x` ",
        " subtask `a` -> subtask `b` ",
    ] {
        assert!(fault.reason.contains(part), "{}", fault.reason);
    }
}

#[test]
fn a_run_that_stands_twice_or_whose_first_line_is_spoilt_is_named() {
    let spoilt = |spoiler: &str| GOOD.replacen("\n{", &format!("\n{spoiler}{{"), 1);
    let no_begin = "`trace_dag`: no `trace_begin` comes before it; that of line 2 does not begin \
                    with `{`";
    let twice = "`trace_begin`: run 3 stands here twice, first on line 2; give each boot's log \
                 alone";
    for (log, line, reason) in [
        (spoilt(" "), 3, no_begin),
        (spoilt("\u{feff}"), 3, no_begin),
        (GOOD.repeat(2), 10, twice),
    ] {
        let fault = read(&log).unwrap_err();
        assert_eq!((fault.line, fault.reason.as_str()), (line, reason));
    }
}

#[test]
fn what_a_message_repeats_is_short_and_can_be_seen() {
    let long = "x".repeat(5000);
    for (from, to) in [
        ("\"edf\"", format!("\"\\u001b[2J{long}\"")),
        ("\"start\"", format!("\"\\u202e{long}\"")),
    ] {
        let fault = read(&GOOD.replace(from, &to)).unwrap_err();
        assert!(fault.reason.len() < 150, "{}", fault.reason);
        assert!(fault.reason.contains("\\u{"), "{}", fault.reason);
    }
}

#[test]
fn a_chain_of_many_subtasks_is_no_cycle() {
    let subtasks: Vec<String> = (0..3000).map(|n| format!("[\"s{n}\",0,0,null]")).collect();
    let subtasks = subtasks.join(",");
    let edges: Vec<String> = (1..3000).map(|n| format!("[{},{n}]", n - 1)).collect();
    let log = GOOD
        .replace("[[\"a\",0,0,null],[\"b\",1,1,7]]", &format!("[{subtasks}]"))
        .replace("[[0,1]]", &format!("[{}]", edges.join(",")));
    let runs = read(&log).unwrap();
    assert_eq!(runs[0].task_set.dags()[0].subtasks().len(), 3000);
}

#[test]
fn a_log_says_how_strictly_it_is_judged() {
    use crate::trace::bound::{COUNTED_NS, FIFO_NS, NORMAL_NS, REAL_NS, SCHED_EXT_NS};
    let of = |clock: &str, words: &str| {
        let (clock, preempts) = clock.split_once(' ').unwrap_or((clock, "false"));
        let boot = r#"{"kind":"boot","version":"1","app":"a","cpus":2,"memory_kib":1"#;
        let rest = format!(
            "\"clock\":\"{clock}\",\"preemptive\":{preempts},\"command_line\":\"{words}\"}}"
        );
        let mut runs = read(&format!("{boot},{rest}\n{GOOD}")).unwrap();
        runs.remove(0).usual_bound_ns
    };
    assert_eq!(of("pit", "policy=edf mode=deterministic"), COUNTED_NS);
    assert_eq!(of("pit", "mode=threads"), REAL_NS);
    assert_eq!(of("linux true", "policy=edf"), FIFO_NS);
    assert_eq!(of("linux true", "mechanism=sched_ext"), SCHED_EXT_NS);
    assert_eq!(of("linux", "mechanism=fifo"), NORMAL_NS);
    assert_eq!(read(GOOD).unwrap().remove(0).usual_bound_ns, REAL_NS);
}
