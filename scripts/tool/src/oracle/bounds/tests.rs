//! The public cases and examples, and files that are wrong.

use super::{check, parse};

const FILE: &str = include_str!("../../../../../tests/oracle/bounds.txt");
const MULTI_PATH: &str = include_str!("../../../../../tests/oracle/multi_path.txt");

#[test]
fn all_public_cases_agree() {
    for file in [FILE, MULTI_PATH] {
        let cases = parse(file).unwrap();
        assert_eq!(cases.len(), 60);
        for case in &cases {
            assert_eq!(check(case), Ok(()), "{}", case.name);
        }
    }
}

#[test]
fn a_difference_names_the_quantity() {
    let first = FILE.split_inclusive("end\n").next().unwrap();
    let differs = |from: &str, to: &str| {
        assert!(first.contains(from), "{from}");
        let cases = parse(&first.replacen(from, to, 1)).unwrap();
        check(&cases[0]).unwrap_err()
    };
    assert_eq!(
        differs("\nlen 41", "\nlen 42"),
        "dag 1: len: expected 42, computed 41"
    );
    assert_eq!(
        differs("graham 50 long_paths 46", "graham 50 long_paths 47"),
        "dag 2: single 7 long_paths: expected 47, computed 46"
    );
    assert_eq!(
        differs("melani_gedf 11 44 60", "melani_gedf -"),
        "melani_gedf: expected -, computed 11 44 60"
    );
    assert_eq!(
        differs("federated 7", "federated 6 0:1"),
        "federated: expected 6 0:1, computed 7"
    );
}

#[test]
fn malformed_files_are_refused_with_their_line() {
    let first = FILE.split_inclusive("end\n").next().unwrap();
    let refused = |from: &str, to: &str| {
        assert!(first.contains(from), "{from}");
        let error = parse(&first.replacen(from, to, 1)).unwrap_err();
        (error.line, error.reason)
    };
    assert_eq!(refused("dag 31 31", "dag 0 31").0, 2);
    assert_eq!(
        refused("wcet 2 8 1", "wcet 2 8"),
        (3, "`wcet` takes 3 words, found 2".to_owned())
    );
    assert_eq!(
        refused("edge 1 2", "edge 1 3"),
        (6, "there is no subtask 3".to_owned())
    );
    assert_eq!(refused("edge 0 1", "edge 2 1").0, 2, "a cycle");
    assert_eq!(refused("dag 31 31 3 3", "dag 31 31 3 2").0, 6);
    assert_eq!(refused("dag 31 31 3 3", "dag 31 31 4294967296 3").0, 2);
    assert_eq!(refused("wcet 2 8 1", "wcet 2 8 18446744073709551616").0, 3);
    assert_eq!(refused("wcet 2 8 1", "wcet 2 8 18446744073709551615").0, 2);
    assert_eq!(refused("case bpub000 7 3", "case bpub000 0 3").0, 1);
    assert_eq!(refused("case bpub000 7 3", "case bpub000 7 4").0, 28);
    assert_eq!(
        refused("case bpub000 7 3", "case bpub000 4294967295 3"),
        (1, "expected 1 to 64 cores, found 4294967295".to_owned())
    );
    let single = "single 7 graham 41 long_paths 41\n";
    assert_eq!(
        refused(single, ""),
        (17, "the DAG before this has no `single` record".to_owned())
    );
    assert_eq!(
        refused(single, &single.repeat(2)),
        (18, "`single 7` stands here twice".to_owned())
    );
    assert_eq!(refused("single 7 graham 41", "single 65 graham 41").0, 17);
    for order in ["0 1 3", "0 1 1", "0 1 4294967296"] {
        assert_eq!(
            refused("dm_order 0 1 2", &format!("dm_order {order}")),
            (28, "expected each DAG from 0 to 2 once".to_owned())
        );
    }
    assert_eq!(
        refused("federated 7", "federated 7 \u{1b}[2J"),
        (36, "expected dag:cores, found `\\u{1b}[2J`".to_owned())
    );
    assert_eq!(refused("width 1 1 2\n", "").0, 36);
    assert_eq!(refused("bonifaci_gedf 0", "bonifaci_gedf 2").0, 35);
    assert_eq!(refused("federated 7", "federated 7 0").0, 36);
    assert_eq!(refused("\nend\n", "\n").0, 37);
    assert_eq!(parse("").unwrap_err().line, 1);
    assert_eq!(parse("\nfoo\n").unwrap_err().line, 2);
}

#[test]
fn a_case_that_stands_twice_is_refused_with_both_lines() {
    let first = FILE.split_inclusive("end\n").next().unwrap();
    let error = parse(&first.repeat(2)).unwrap_err();
    let reason = "case `bpub000` stands here twice, first on line 1; rename one";
    assert_eq!((error.line, error.reason.as_str()), (38, reason));
    let error = parse(&first.replacen("bpub000", "b\u{202e}", 1)).unwrap_err();
    assert_eq!(
        error.reason,
        "case `b\\u{202e}`: a name must be seen; rename it"
    );
}
