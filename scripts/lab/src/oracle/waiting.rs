//! Reference values of subtasks with waits: schedules and bounds, in one file.
//!
//! A file has two kinds of blocks. A block from `case` to `end` is one of the [schedules];
//! [`bounds`] reads a block from `bounds` to `end`.

use text::{Malformed, blocks};

use super::bounds::{self, BoundsCase};
use super::schedules::{self, Case};
use super::{FileOracle, case};

/// The kind `waiting`.
pub(super) static ORACLE: FileOracle<WaitingCase> = FileOracle {
    invocation: "./scripts/oracle waiting",
    about: "Compares schedules of subtasks that wait with those of the scheduler in virtual time, \
            and bounds with those of the analysis at commit.",
    parse,
    check,
    name: |case| match case {
        WaitingCase::Schedule(case) => &case.name,
        WaitingCase::Bounds(case) => &case.name,
    },
    schedules: Some(parse_schedules),
};

/// A block of a file.
#[derive(Debug)]
pub enum WaitingCase {
    /// A schedule.
    Schedule(Box<Case>),
    /// Bounds of a set.
    Bounds(BoundsCase),
}

/// Reads all blocks of a file.
///
/// # Errors
///
/// [`Malformed`] for the first record that deviates from the modules' descriptions.
pub fn parse(text: &str) -> Result<Vec<WaitingCase>, Malformed> {
    blocks(text, &["case", "bounds"], |header, lines| {
        match header.kind {
            "bounds" => bounds::parse_case(header, lines).map(WaitingCase::Bounds),
            _ => case::parse_case(header, lines).map(|case| WaitingCase::Schedule(Box::new(case))),
        }
    })
}

/// Reads all blocks of a file, and returns the schedules.
fn parse_schedules(text: &str) -> Result<Vec<Case>, Malformed> {
    let schedule = |case| match case {
        WaitingCase::Schedule(case) => Some(*case),
        WaitingCase::Bounds(_) => None,
    };
    Ok(parse(text)?.into_iter().filter_map(schedule).collect())
}

/// Compares all values of a block.
///
/// # Errors
///
/// The first difference, in one line.
pub fn check(case: &WaitingCase) -> Result<(), String> {
    match case {
        WaitingCase::Schedule(case) => schedules::check(case),
        WaitingCase::Bounds(case) => bounds::check(case),
    }
}

#[cfg(test)]
mod tests {
    use super::{ORACLE, WaitingCase, parse};
    use crate::oracle::judged::{assert_agree, assert_differs};
    use crate::tests::assert_malformed;

    const FILE: &str = include_str!("../../../../tests/oracle/waiting.txt");

    #[test]
    fn all_public_sets_agree() {
        let is_set = |case: &&WaitingCase| matches!(case, WaitingCase::Bounds(_));
        let cases = parse(FILE).unwrap();
        assert_eq!(cases.iter().filter(is_set).count(), 40);
        assert_agree(&ORACLE, FILE, 80);
    }

    fn first() -> &'static str {
        let begin = FILE.find("bounds wb000").unwrap();
        FILE[begin..].split_inclusive("end\n").next().unwrap()
    }

    /// A part of the first set, its replacement, and the resulting difference.
    const WRONG: &str = "\
len 35 | len 36 | dag 1: len: expected 36, computed 35
vol 102 | vol 101 | dag 1: vol: expected 101, computed 102
span 71 | span 70 | dag 1: span: expected 70, computed 71
width 6 | width 7 | dag 1: width: expected 7, computed 6
cov 71 96 114 | cov 71 96 115 | dag 1: cov: expected 71 96 115 131 144 151, computed 71 96 114 131 144 151
alone 2 104 peel 104 | alone 2 103 peel 104 | dag 1: alone 2: expected 103 peel 104 least 104 spread 111, computed 104 peel 104 least 104 spread 111
alone 2 104 peel 104 | alone 2 104 peel 103 | dag 1: alone 2: expected 104 peel 103 least 104 spread 111, computed 104 peel 104 least 104 spread 111
least 104 spread 111 | least 105 spread 111 | dag 1: alone 2: expected 104 peel 104 least 105 spread 111, computed 104 peel 104 least 104 spread 111
least 104 spread 111 | least 104 spread 112 | dag 1: alone 2: expected 104 peel 104 least 104 spread 112, computed 104 peel 104 least 104 spread 111
dm_order 0 2 1 | dm_order 0 1 2 | dm_order: expected 0 1 2, computed 0 2 1
wait_gfp_dm 53 60 156 | wait_gfp_dm 53 61 156 | wait_gfp_dm: expected 53 61 156, computed 53 60 156
wait_gfp_dm_best 53 50 | wait_gfp_dm_best 53 51 | wait_gfp_dm_best: expected 53 51 156, computed 53 50 156
wait_np_gfp_dm - | wait_np_gfp_dm 53 60 156 | wait_np_gfp_dm: expected 53 60 156, computed -
wait_gedf_best - | wait_gedf_best 53 60 156 | wait_gedf_best: expected 53 60 156, computed -
wait 5 2 1 7 1 10 1 | wait 5 2 1 7 1 9 1 | dag 0: span: expected 53, computed 52";

    #[test]
    fn a_difference_names_the_quantity() {
        assert_differs(&ORACLE, first(), WRONG);
    }

    /// The same for refusals, with the line and the reason.
    const MALFORMED: &str = r"bounds wb000 2 3 | bound wb000 2 3 | 1 | expected a `case` or `bounds` record, found `bound`
bounds wb000 2 3 | bounds wb000 0 3 | 1 | expected 1 to 64 cores
wait 0 1 1 4 1 | wait 6 1 1 4 1 | 9 | there is no subtask 6
wait 0 1 1 4 1 | wait 0 0 1 4 1 | 9 | needs at least 1
wait 0 1 1 4 1 | wait 0 2 1 4 1 | 9 | 2 waits take twice as many times and one, found 3
wait 0 1 1 4 1 | wait 0 1 2 4 1 | 9 | segments of at least 1 that sum up to 2
wait 0 1 1 4 1 | wait 0 1 2 4 0 | 9 | segments of at least 1 that sum up to 2
wait 0 1 1 4 1 | wait 3 1 2 4 1 | 10 | the waits of subtask 3 stand here twice
wait 0 1 1 4 1 | wait 0 1 1 18446744073709551615 1 | 11 | the limits of waits exceeds 64 bits
alone 1 53 peel | alone 1 53 paths | 17 | expected `alone M A peel P least L spread X`
alone 2 53 peel | alone 1 53 peel | 18 | `alone 1` stands here twice
span 53 | len 53 | 14 | `len` stands here twice
wait_np_gedf -\n |  | 60 | expected a `wait_np_gedf` record, found `end`
\nend\n | \n | 61 | the file ends";

    #[test]
    fn malformed_files_are_refused_with_their_line() {
        assert_malformed(parse, first(), MALFORMED);
    }
}
