//! The comparison on the host: what is near, what is not, and what is missing.

use super::compare::compare;
use super::transcript::read;
use super::{Deviation, Settings};
use crate::oracle::schedules::parse;
use crate::protocol::Transcript;

const CASE: &str = "case small 1 0 1 1
dag 4 4 0 2 2 1
sub 1 0 1 1
sub 4 0 4 4
edge 0 1
x 0 0 0 0 1 0
x 0 0 1 1 5 0
x 0 1 0 5 6 0
x 0 1 1 6 10 0
j 0 0 0 5 5 1
j 0 1 4 10 6 1
end
";

/// A run of it with units of 1 ms: everything is 10 us late or early.
const LOG: &str = r#"
{"kind":"replay","case":"other","cores":1,"violations":0,"allocations":0}
{"kind":"replay_instances","rows":[[0,0,0,1,2,0]]}
{"kind":"replay","case":"small","cores":1,"violations":0,"allocations":0}
{"kind":"replay_instances","rows":[[0,0,0,10000,990000,0],[0,0,1,1010000,4990000,0]]}
{"kind":"replay_instances","rows":[[0,1,0,5010000,5990000,0],[0,1,1,6010000,9990000,0]]}
{"kind":"replay_jobs","rows":[[0,0,0,4990000,1],[0,1,4000000,9990000,1]]}
{"kind":"replay","case":"next","cores":1,"violations":0,"allocations":0}
"#;

/// What stands in the log, what is put in its place, and the difference that makes; none if not
/// all of the run is there.
const ALTERED: &str = r#"[0,1,0,5010000, | [0,1,0,5021000, | dag 0 job 1 subtask 0: start: expected at 5, ran at 5.021 units
4990000,0]] | 4979999,0]] | dag 0 job 0 subtask 1: finish: expected at 5, ran at 4.979 units
9990000,0]] | 9990000,1]] | dag 0 job 1 subtask 1: preemptions: expected 0, ran 1
4000000, | 4000001, | dag 0 job 1: release: expected 4000000, ran 4000001
9990000,1]] | 9990000,0]] | dag 0 job 1: missed: expected 1, ran 0
"small","cores":1,"violations":0 | "small","cores":1,"violations":2 | the run breaks the model's rules in 2 places
"small" | "smart"
,[0,1,1,6010000,9990000,0] |
[0,0,0,4990000,1], |
[0,1,0,5010000, | [0,0,0,5010000,
[0,1,0,5010000, | [0,1,0,null,"#;

#[test]
fn what_is_near_passes_and_the_first_difference_is_named() {
    let case = parse(CASE).expect("well formed").remove(0);
    let settings = Settings::for_unit(1000);
    let compared = |log: &str| {
        let ran = read(&Transcript::read(log), &case)?;
        Some(compare(&case, &ran, &settings))
    };
    let deviation = Deviation {
        earliest_ns: -10_000,
        latest_ns: 10_000,
    };
    assert_eq!(compared(LOG), Some(Ok(deviation)));
    for row in ALTERED.lines() {
        let mut cells = row.split('|').map(str::trim);
        let (from, to) = (cells.next().expect(row), cells.next().expect(row));
        assert!(LOG.contains(from), "{from}");
        let difference = cells.next().map(|difference| Err(difference.into()));
        assert_eq!(compared(&LOG.replace(from, to)), difference, "{to}");
    }
}
