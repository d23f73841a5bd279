//! What a boot prints of a case, held against it: what passes, and what is found out.

use super::Settings;
use super::boots::judge;
use crate::oracle::schedules::{Deviation, parse};
use crate::outcome::Outcome;
use crate::protocol::Status;
use crate::qemu::Ending;

const CASE: &str = "case small 1 0 1 1
dag 4 9 0 1 1 0
sub 1 0 1
x 0 0 0 0 1 0
j 0 0 0 1 1 0
end
";

/// A run of it with units of 1 ms: it starts 10 us late and finishes 10 us early.
const LOG: &str = r#"{"kind":"trace_begin","policy":"static","preemption":"on","cores":1,"run":0}
{"kind":"trace_dag","dag":0,"name":"0","period_ns":4000000,"relative_deadline_ns":9000000,"offset_ns":0,"in_flight":1,"overrun":"queue","subtasks":[["a",0,0,null]],"edges":[]}
{"kind":"trace","events":[[0,"released",0,0,0,-1],[0,"ready",0,0,0,0],[10000,"start",0,0,0,0]]}
{"kind":"trace","events":[[990000,"finish",0,0,0,0],[990000,"completed",0,0,0,-1]]}
{"kind":"trace_end","events":5,"lost":0}
{"kind":"replay","case":"small","cores":1,"violations":0,"allocations":0}
{"kind":"verdict","status":"success","reason":""}
"#;

/// What stands in the log, what is put in its place, and the difference that makes.
const ALTERED: &str = r#"[10000, | [20001, | dag 0 job 0 subtask 0: start: expected 0, found 0.020
990000, | 979999, | dag 0 job 0 subtask 0: finish: expected 1, found 0.979
[990000,"finish" | [500000,"suspend",0,0,0,0],[600000,"request",0,0,0,0],[600000,"resume",0,0,0,0],[990000,"finish" | dag 0 job 0 subtask 0: preemptions: expected 0, found 1
"offset_ns":0 | "offset_ns":1 | dag 0 job 0: release: expected 0, found 1
[990000,"completed" | [1020001,"completed" | dag 0 job 0: response: expected 1, found 1.020
[990000,"completed" | [990000,"missed",0,0,0,-1],[990000,"completed" | dag 0 job 0: missed: expected 0, found 1
"lost":0 | "lost":2 | its trace is not whole, before line 6
"small" | "smart" | its trace is not whole, before line 6
"allocations":0 | "allocations":1 | the guest itself: allocations: expected 0, found 1
"violations":0 | "violations":1 | the guest itself: violations: expected 0, found 1
,[990000,"completed",0,0,0,-1] | | dag 0 job 0: response: there was none
"success" | "failure" | the verdict line says Failure, QEMU's exit status Success"#;

#[test]
fn what_is_near_passes_and_the_first_difference_is_named() {
    let case = parse(CASE).expect("well formed").remove(0);
    let judged = |log: &str| {
        let status = Ending::Guest(Status::Success);
        let outcome = Outcome::of(status, log.into(), "no.log".as_ref(), "no image".as_ref());
        let judged = judge(&outcome, &[(&case, CASE)], &Settings::for_unit(1000));
        judged.into_iter().next().expect("a case").outcome
    };
    let deviation = Deviation {
        earliest_ns: -10_000,
        latest_ns: 10_000,
    };
    assert_eq!(judged(LOG), Ok(deviation));
    for row in ALTERED.lines() {
        let mut cells = row.split('|').map(str::trim);
        let mut cell = || cells.next().expect(row);
        let (from, to, difference) = (cell(), cell(), cell());
        assert!(LOG.contains(from), "{from}");
        let log = LOG.replacen(from, to, 1);
        let events = format!("\"events\":{}", log.matches("\",0,0,0,").count());
        assert_eq!(
            judged(&log.replace("\"events\":5", &events)),
            Err(difference.into()),
            "{to}"
        );
    }
    let end = LOG.find("{\"kind\":\"replay\"").expect("a line");
    let cut = judged(&LOG[..end]).expect_err("it ends early");
    assert!(cut.starts_with("did not run: "), "{cut}");
}
