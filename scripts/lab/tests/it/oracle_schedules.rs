//! The scheduler against reference schedules, and the refusal of broken files.

use lab::oracle::schedules::{check, parse};
use lab::oracle::waiting::{self, WaitingCase};

use crate::tests::{altered, assert_malformed, rows};

const PUBLIC: &str = include_str!("../../../../tests/oracle/schedules.txt");
const WITH_WAITS: &str = include_str!("../../../../tests/oracle/waiting.txt");
const CLUSTERS: &str = include_str!("../../../../tests/oracle/clusters.txt");

/// One core, a chain of two, two jobs that overlap.
const SMALL: &str = "case small 1 0 1 1
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

/// The page's tests play the same by DAG files; `in_kernel` tells how far a time may be off.
#[test]
fn all_public_schedules_agree() {
    let schedule = |case| match case {
        WaitingCase::Schedule(case) => Some(*case),
        WaitingCase::Bounds(_) => None,
    };
    let waiting = waiting::parse(WITH_WAITS);
    let waiting = waiting.map(|blocks| blocks.into_iter().filter_map(schedule).collect());
    for (cases, count) in [(parse(PUBLIC), 40), (parse(CLUSTERS), 30), (waiting, 40)] {
        let cases = cases.expect("the file is well formed");
        assert_eq!(cases.len(), count);
        for case in cases {
            assert_eq!(check(&case), Ok(()), "{}", case.name);
        }
    }
}

/// A part of the small case, its replacement, and the difference that it makes.
const WRONG: &str =
    "x 0 1 0 5 6 0 | x 0 1 0 4 6 0 | dag 0 job 1 subtask 0: start: expected 4, found 5
x 0 1 1 6 10 0 | x 0 1 1 6 11 0 | dag 0 job 1 subtask 1: finish: expected 11, found 10
j 0 1 4 10 6 1 | j 0 1 5 10 6 1 | dag 0 job 1: release: expected 5, found 4
j 0 1 4 10 6 1 | j 0 1 4 11 6 1 | dag 0 job 1: finish: expected 11, found 10
x 0 1 1 6 10 0 | x 0 1 1 6 10 1 | dag 0 job 1 subtask 1: preemptions: expected 1, found 0
j 0 0 0 5 5 1 | j 0 0 0 5 5 0 | dag 0 job 0: missed: expected 0, found 1
j 0 1 4 10 6 1 | j 0 1 4 10 7 1 | dag 0 job 1: response: expected 7, found 6";

#[test]
fn the_first_difference_is_named() {
    for [from, to, difference] in rows(WRONG) {
        let cases = parse(&altered(SMALL, [&from, &to])).expect("still well formed");
        assert_eq!(check(&cases[0]), Err(difference));
    }
}

/// A part of the small case, its replacement, and the line and the reason of the refusal.
const MALFORMED: &str = r"case small 1 0 1 1 | case small 0 0 1 1 | 1 | expected 1 to 64 cores, found 0
case small 1 0 1 1 | case small 4294967295 0 1 1 | 1 | expected 1 to 64 cores, found 4294967295
case small 1 0 1 1 | case small 1 2 1 1 | 1 | expected 0 or 1
case small 1 0 1 1 | case small 1 0 1 | 1 | takes 5 words
case small 1 0 1 1 | case small 1 0 1 2 | 6 | expected a `dag` record
dag 4 4 0 2 2 1 | clusters 1 1\ndag 4 4 0 2 2 1\nin 0 | 2 | clusters of 1 cores in all, found 2
dag 4 4 0 2 2 1 | clusters 1 0\ndag 4 4 0 2 2 1\nin 0 | 2 | at least 1 core for each cluster
dag 4 4 0 2 2 1 | clusters 1\ndag 4 4 0 2 2 1 | 4 | expected a `in` record
dag 4 4 0 2 2 1 | clusters 1\ndag 4 4 0 2 2 1\nin 1 | 4 | no cluster 1
dag 4 4 0 2 2 1 | dag 4 4 0 2 2 1\nin 0 | 3 | expected a `sub` record
dag 4 4 0 2 2 1 | dag 0 4 0 2 2 1 | 2 | period of 0
dag 4 4 0 2 2 1 | dag 4 0 0 2 2 1 | 2 | deadline of 0
dag 4 4 0 2 2 1 | dag 4 4 0 0 2 1 | 2 | needs at least 1
dag 4 4 0 2 2 1 | dag 4 4 0 4294967296 2 1 | 2 | too large
dag 4 4 0 2 2 1 | dag 4 4 0 2 2 2 | 6 | expected a `edge` record
dag 4 4 0 2 2 1 | dag 4 4 18446744073709551615 2 2 1 | 2 | exceeds 18446744073709551615
dag 4 4 0 2 2 1 | dag 4 4 18446744073709551616 2 2 1 | 2 | too large
dag 4 4 0 2 2 1 | dag 4 4 18446744073709551605 2 2 1 | 1 | may end after
dag 4 4 0 2 2 1 | dag 4 -4 0 2 2 1 | 2 | not a whole number
sub 1 0 1 1 | sub 1 0 1 | 3 | for each of 2 jobs, found 1
sub 1 0 1 1 | sub 1 0 1 2 | 3 | not between 1 and the WCET 1
sub 1 0 1 1 | sub 1 0 0 1 | 3 | not between 1 and the WCET 1
sub 1 0 1 1 | sub 1 4294967296 1 1 | 3 | too large
edge 0 1 | edge 0 2 | 5 | no subtask 2
edge 0 1 | edge 1 1 | 2 | precedes itself
1 0 1 1\ndag 4 4 0 2 2 1\nsub 1 0 1 1\nsub 4 0 4 4 | 1 0 1 1\ndag 4 4 0 2 2 2\nsub 1 0 1 1\nsub 4 0 4 4\nedge 1 0 | 2 | subtask `0` -> subtask `1` -> subtask `0`
edge 0 1 | edge 0 1\nsink 2 3 | 6 | no subtask 2
edge 0 1 | edge 0 1\nsink 1 | 6 | takes 2 words
edge 0 1 | edge 0 1\nsink 1 3\nsink 1 3 | 7 | twice
edge 0 1 | edge 0 1\nsink 1 0 | 4 | deadline of 0
edge 0 1 | edge 0 1\nsink 1 5 | 4 | longer than its DAG's
edge 0 1 | edge 0 1\nsink 0 3 | 3 | is no sink
x 0 0 1 1 5 0\n |  | 11 | without 1 `x` records
x 0 0 1 1 5 0 | x 0 0 0 1 5 0 | 7 | twice
x 0 0 1 1 5 0 | x 0 2 1 1 5 0 | 7 | no job 2
x 0 0 1 1 5 0 | x 1 0 1 1 5 0 | 7 | no dag 1
j 0 1 4 10 6 1 | j 0 1 4 10 6 2 | 11 | expected 0 or 1
j 0 1 4 10 6 1 | k 0 1 4 10 6 1 | 11 | expected `x`, `s`, `j` or `end`
end\n |  | 12 | the file ends";

#[test]
fn malformed_files_are_refused_with_their_line() {
    assert_malformed(parse, SMALL, MALFORMED);
    assert_eq!(parse("").expect_err("no case").line, 1);
}

/// One core, and a subtask that waits above another one; its answer comes at the limit.
const WAITING: &str = "case waiting 1 0 1 2
dag 20 20 0 1 1 0
sub 3 0 3
wait 0 1 2 3 1
act 0 0 2 3 1
dag 20 20 0 1 1 0
sub 4 1 4
x 0 0 0 0 6 0
x 1 0 0 2 7 1
s 0 0 0 0 0 2 5 6
j 0 0 0 6 6 0
j 1 0 0 7 7 0
end
";

/// Parts of the waiting case, their replacement, and the first difference, if any.
const WAITS: &str =
    "act 0 0 2 3 1 | act 0 0 2 4 1 | dag 0 job 0 subtask 0: time-outs: expected 0, found 1
act 0 0 2 3 1 | act 0 0 2 2 1 | dag 0 job 0 subtask 0: finish: expected 6, found 5
s 0 0 0 0 0 2 5 6 | s 0 0 0 1 0 2 5 6 | dag 0 job 0 subtask 0: time-outs: expected 1, found 0
s 0 0 0 0 0 2 5 6 | s 0 0 0 0 0 2 4 6 | dag 0 job 0 subtask 0 segment 1: start: expected 4, found 5
s 0 0 0 0 0 2 5 6 | s 0 0 0 0 0 3 5 6 | dag 0 job 0 subtask 0 segment 0: end: expected 3, found 2
x 1 0 0 2 7 1 | x 1 0 0 2 7 0 | dag 1 job 0 subtask 0: preemptions: expected 0, found 1";

/// Parts of the waiting case, their replacement, and the line and the reason of the refusal.
const MALFORMED_WAITS: &str = r"wait 0 1 2 3 1 | wait 0 0 2 | 4 | needs at least 1
wait 0 1 2 3 1 | wait 0 2 2 3 1 | 4 | 2 waits take twice as many times and one, found 3
wait 0 1 2 3 1 | wait 1 1 2 3 1 | 4 | no subtask 1
wait 0 1 2 3 1 | wait 0 1 2 18446744073709551615 1 | 1 | may end after
act 0 0 2 3 1 | act 0 1 2 3 1 | 5 | expected `act 0 0 ..`
act 0 0 2 3 1 | act 0 0 1 3 1 | 5 | do not come to its execution time 3
act 0 0 2 3 1 | act 0 0 2 3 1\nwait 0 1 2 3 1 | 6 | has its waits already
act 0 0 2 3 1 | act 0 0 2 3 | 5 | takes 5 words
act 0 0 2 3 1\n |  | 5 | expected a `act` record
s 0 0 0 0 0 2 5 6 | s 0 0 0 0 0 2 5 | 10 | the spans of the segments
s 0 0 0 0 0 2 5 6 | s 1 0 0 0 0 2 5 6 | 10 | the spans of the segments
s 0 0 0 0 0 2 5 6 | s 0 0 0 0 0 2 5 6\ns 0 0 0 0 0 2 5 6 | 11 | twice
s 0 0 0 0 0 2 5 6\n |  | 12 | 1 `s` records";

#[test]
fn waits_agree_and_their_first_difference_is_named() {
    let checked = |text: &str| check(&parse(text).expect("well formed")[0]);
    assert_eq!(checked(WAITING), Ok(()));
    for [from, to, difference] in rows(WAITS) {
        let found = checked(&altered(WAITING, [&from, &to]));
        assert_eq!(found, Err(difference), "{to}");
    }
    assert_malformed(parse, WAITING, MALFORMED_WAITS);
}

#[test]
fn far_apart_times_and_as_many_cores_as_there_can_be_are_no_trouble() {
    let text = "case far 64 1 1 1
dag 9000000000000000000 9000000000000000000 5 2 1 0
sub 3 0 1 3
x 0 0 0 5 6 0
x 0 1 0 9000000000000000005 9000000000000000008 0
j 0 0 5 6 1 0
j 0 1 9000000000000000005 9000000000000000008 3 0
end
";
    let cases = parse(text).expect("well formed");
    assert_eq!(check(&cases[0]), Ok(()));
}
