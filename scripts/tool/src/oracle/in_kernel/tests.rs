//! The print of a boot of a case, held against it: what passes, and what is found out.

use super::Settings;
use super::boots::judge;
use crate::made::{self, line_of, record_of};
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

/// A run of it with units of 1 ms, which starts 10 us late and finishes 10 us early: what is
/// committed, what happened, and what is printed.
const LOG: &str = r#"static 1
0 T=4000000 D=9000000 O=0: a/0
;
0 released c0 0.0
0 ready c0 0.0.0
10000 start c0 0.0.0
990000 finish c0 0.0.0
990000 completed c0 0.0
;
{"kind":"replay","case":"small","cores":1,"violations":0,"allocations":0}
{"kind":"verdict","status":"success","reason":""}
"#;

/// A part of that, what is put in its place, and the difference that makes.
const ALTERED: &str = r#"10000 | 20001 | dag 0 job 0 subtask 0: start: expected 0, found 0.020
990000 finish | 979999 finish | dag 0 job 0 subtask 0: finish: expected 1, found 0.979
990000 finish | 500000 suspend c0 0.0.0;600000 request c0 0.0.0;600000 resume c0 0.0.0;990000 finish | dag 0 job 0 subtask 0: preemptions: expected 0, found 1
O=0 | O=1 | dag 0 job 0: release: expected 0, found 1
990000 completed | 1020001 completed | dag 0 job 0: response: expected 1, found 1.020
990000 completed | 990000 missed c0 0.0;990000 completed | dag 0 job 0: missed: expected 0, found 1
0 released c0 | lost 2;0 released c0 | its trace is not whole, before line 2
"small" | "smart" | its trace is not whole, before line 2
"allocations":0 | "allocations":1 | the guest itself: allocations: expected 0, found 1
"violations":0 | "violations":1 | the guest itself: violations: expected 0, found 1
990000 completed c0 0.0 | | dag 0 job 0: response: there was none
"success" | "failure" | the verdict line says Failure, QEMU's exit status Success"#;

#[test]
fn what_is_near_passes_and_the_first_difference_is_named() {
    let case = parse(CASE).expect("well formed").remove(0);
    let judged_of = |log: String| {
        let status = Ending::Guest(Status::Success);
        let outcome = Outcome::of(status, log, "no.log".as_ref(), "no image".as_ref());
        let judged = judge(&outcome, &[(&case, CASE)], &Settings::for_unit(1000));
        judged.into_iter().next().expect("a case").outcome
    };
    let judged = |text: &str| {
        let [commit, events, lines] = parts(text);
        judged_of(line_of(&record_of("", &made::commit(commit), events)) + lines)
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
        let altered = LOG.replacen(from, &to.replace(';', "\n"), 1);
        assert_eq!(judged(&altered), Err(difference.into()), "{to}");
    }
    let [commit, events, lines] = parts(LOG);
    let whole = record_of("", &made::commit(commit), events);
    let said = judged_of(line_of(&whole[..whole.len() / 2]) + lines).expect_err("it is cut");
    assert!(said.starts_with("did not run: "), "{said}");
    let said = judged_of(line_of(&whole)).expect_err("it ends early");
    assert!(said.starts_with("did not run: "), "{said}");
}

fn parts(text: &str) -> [&str; 3] {
    let parts: Vec<&str> = text.split("\n;\n").collect();
    parts.try_into().expect("three parts")
}
