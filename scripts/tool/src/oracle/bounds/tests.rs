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

/// Returns the cells of each row, and the first public case with the second cell, in which `\n`
/// is the end of a line and `\x` turns what follows, in place of the first.
fn altered(rows: &str) -> impl Iterator<Item = (Vec<&str>, String)> {
    let first = FILE.split_inclusive("end\n").next().unwrap();
    rows.lines().map(move |row| {
        let cells: Vec<&str> = row.split(" | ").collect();
        let told = |cell: &str| cell.replace(r"\n", "\n").replace(r"\x", "\u{202e}");
        let [from, to] = [cells[0], cells[1]].map(told);
        assert!(first.contains(&from), "{from}");
        (cells, first.replacen(&from, &to, 1))
    })
}

/// What stands in the first case, what is put in its place, and the difference that makes.
const WRONG: &str = r"\nlen 41 | \nlen 42 | dag 1: len: expected 42, computed 41
graham 50 long_paths 46 | graham 50 long_paths 47 | dag 2: single 7 long_paths: expected 47, computed 46
melani_gedf 11 44 60 | melani_gedf - | melani_gedf: expected -, computed 11 44 60
federated 7 | federated 6 0:1 | federated: expected 6 0:1, computed 7";

#[test]
fn a_difference_names_the_quantity() {
    for (cells, text) in altered(WRONG) {
        let cases = parse(&text).unwrap();
        assert_eq!(check(&cases[0]), Err(cells[2].to_owned()));
    }
}

/// The same of what is refused: with its line, and the reason if it is worth its words.
const MALFORMED: &str = r"dag 31 31 | dag 0 31 | 2
wcet 2 8 1 | wcet 2 8 | 3 | `wcet` takes 3 words, found 2
edge 1 2 | edge 1 3 | 6 | there is no subtask 3
edge 0 1 | edge 2 1 | 2 | cycle
dag 31 31 3 3 | dag 31 31 3 2 | 6
dag 31 31 3 3 | dag 31 31 4294967296 3 | 2
wcet 2 8 1 | wcet 2 8 18446744073709551616 | 3
wcet 2 8 1 | wcet 2 8 18446744073709551615 | 2
case bpub000 7 3 | case bpub000 0 3 | 1
case bpub000 7 3 | case bpub000 7 4 | 28
case bpub000 7 3 | case bpub000 4294967295 3 | 1 | expected 1 to 64 cores, found 4294967295
case bpub000 7 3 | case b\x 7 3 | 1 | case `b\u{202e}`: a name must be seen; rename it
single 7 graham 41 long_paths 41\n |  | 17 | the DAG before this has no `single` record
single 7 graham 41 long_paths 41\n | single 7 graham 41 long_paths 41\nsingle 7 graham 41 long_paths 41\n | 18 | `single 7` stands here twice
single 7 graham 41 | single 65 graham 41 | 17
dm_order 0 1 2 | dm_order 0 1 3 | 28 | expected each DAG from 0 to 2 once
dm_order 0 1 2 | dm_order 0 1 1 | 28 | expected each DAG from 0 to 2 once
dm_order 0 1 2 | dm_order 0 1 4294967296 | 28 | expected each DAG from 0 to 2 once
federated 7 | federated 7 \x | 36 | expected dag:cores, found `\u{202e}`
width 1 1 2\n |  | 36
bonifaci_gedf 0 | bonifaci_gedf 2 | 35
federated 7 | federated 7 0 | 36
\nend\n | \n | 37";

#[test]
fn malformed_files_are_refused_with_their_line() {
    for (cells, text) in altered(MALFORMED) {
        let error = parse(&text).unwrap_err();
        assert_eq!(error.line.to_string(), cells[2], "{}: {error}", cells[1]);
        let reason = cells.get(3).unwrap_or(&"");
        assert!(error.reason.contains(reason), "{error}\n  not: {reason}");
    }
    assert_eq!(parse("").unwrap_err().line, 1);
    assert_eq!(parse("\nfoo\n").unwrap_err().line, 2);
    let first = FILE.split_inclusive("end\n").next().unwrap();
    let error = parse(&first.repeat(2)).unwrap_err();
    let reason = "case `bpub000` stands here twice, first on line 1; rename one";
    assert_eq!((error.line, error.reason.as_str()), (38, reason));
}
