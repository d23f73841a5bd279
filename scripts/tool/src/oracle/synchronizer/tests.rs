//! The public cases, and files and expectations that are wrong.

use super::{check, parse};

const PUBLIC: &str = include_str!("../../../../../tests/oracle/synchronizer.txt");

/// One set of equal stamps, one stamp that is overtaken.
const EXACT: &str = "case e exact 2 5
a 0 7 1
a 0 8 2
a 1 4 2
s 2 8 4
r 2 0 7
end
";

/// A set that only a later message proves best, with a penalty of 0.
const APPROXIMATE: &str = "case a approximate 2 5
approximate 100 1 0 0 0
a 0 0 0
a 1 0 10
a 0 1 19
s 2 1 0
r 2 0 0
end
";

/// Returns each row of tables, with the case that it is about.
fn rows<'a>(tables: &'a [(&'a str, &'a str)]) -> impl Iterator<Item = (&'a str, &'a str)> {
    (tables.iter()).flat_map(|(text, table)| table.lines().map(move |row| (*text, row)))
}

/// Splits a row of a table.
fn split<const N: usize>(row: &str) -> [&str; N] {
    let cells: Vec<&str> = row.split(" | ").collect();
    cells.try_into().expect(row)
}

#[test]
fn all_public_traces_agree() {
    let cases = parse(PUBLIC).unwrap();
    assert_eq!(cases.len(), 40);
    for case in &cases {
        assert_eq!(check(case), Ok(()), "{}", case.name);
    }
}

/// What stands in a case, what is put in its place, and the difference that makes.
const EXACT_WRONG: &str = r"s 2 8 4 | s 2 7 4 | arrival 2 (topic 1, message 4): set 0: expected 7 4, emitted 8 4
s 2 8 4\n |  | arrival 2 (topic 1, message 4): set 0: expected none, emitted 8 4
s 2 8 4 | s 2 8 4\ns 2 8 999 | arrival 2 (topic 1, message 4): set 1: expected 8 999, emitted none
s 2 8 4 | s 1 8 4 | arrival 1 (topic 0, message 8): set 0: expected 8 4, emitted none";
const APPROXIMATE_WRONG: &str = r"r 2 0 0\n |  | arrival 2 (topic 0, message 1): message 0 of topic 0: dropped, but expected not to leave
r 2 0 0 | r 1 0 0 | arrival 1 (topic 1, message 0): message 0 of topic 0: expected to leave, but was not dropped
a 0 1 19 | a 0 1 20 | arrival 2 (topic 0, message 1): set 0: expected 1 0, emitted 0 0";

#[test]
fn the_first_difference_is_named() {
    let tables = [(EXACT, EXACT_WRONG), (APPROXIMATE, APPROXIMATE_WRONG)];
    for (text, row) in rows(&tables) {
        let row = row.replace(r"\n", "\n");
        let [from, to, difference] = split(&row);
        assert!(text.contains(from), "{from}");
        let cases = parse(&text.replacen(from, to, 1)).expect("still well formed");
        assert_eq!(check(&cases[0]), Err(difference.to_owned()));
    }
}

#[test]
fn neither_the_order_of_what_leaves_nor_a_size_of_queues_matters() {
    let in_any_order = "case e exact 2 5\na 0 0 1\na 0 1 1\na 0 2 2\na 0 3 3\na 1 0 3\n\
                        s 4 3 0\nr 4 0 2\nr 1 0 0\nr 4 0 1\nend\n";
    let without_limit = EXACT.replacen("exact 2 5", "exact 2 0", 1);
    // A queue costs no more than the arrivals.
    let largest = format!("2 {}", usize::MAX);
    let [exact, approximate] = [EXACT, APPROXIMATE].map(|text| text.replacen("2 5", &largest, 1));
    for text in [in_any_order, &without_limit, &exact, &approximate] {
        assert_eq!(check(&parse(text).unwrap()[0]), Ok(()), "{text}");
    }
}

/// The same of what is refused: with its line and the reason.
const EXACT_MALFORMED: &str = r"case e | kase e | 1 | expected a `case` record
exact 2 5 | exact 2 | 1 | takes 4 words, found 3
exact 2 5 | exactly 2 5 | 1 | found `exactly`
exact 2 5 | exact 0 5 | 1 | 1 to 1024 topics
exact 2 5 | exact 1025 5 | 1 | 1 to 1024 topics
exact 2 5 | exact 2 -5 | 1 | not a whole number
a 0 7 1 | a 2 7 1 | 2 | there is no topic 2
a 0 8 2 | a 0 7 2 | 3 | message 7 of topic 0 arrives twice
a 1 4 2 | a 1 4 2.5 | 4 | not a whole number
a 1 4 2 | a 1 4 | 4 | takes 3 words, found 2
a 1 4 2 | a 1 4 18446744073709551616 | 4 | too large
s 2 8 4 | s 3 8 4 | 5 | there is no arrival 3
s 2 8 4 | s 2 8 | 5 | takes 3 words, found 2
s 2 8 4 | s 2 8 x | 5 | not a whole number
s 2 8 4 | t 2 8 4 | 5 | expected `a`, `s`, `r` or `end`
r 2 0 7 | r 2 2 7 | 6 | there is no topic 2
r 2 0 7 | r 9 0 7 | 6 | there is no arrival 9
r 2 0 7 | r 2 0 7\nr 2 0 7 | 7 | leaves twice
end | end 1 | 7 | takes 0 words, found 1
end\n |  | 7 | the file ends where `end` should be";
const APPROXIMATE_MALFORMED: &str = r"approximate 2 5 | approximate 2 0 | 1 | at least 1
approximate 2 5 | exact 2 5 | 2 | found `approximate`
100 1 0 0 0 | 100 1 0 0 | 2 | takes 5 words, found 4
100 1 0 0 0 | 1e2 1 0 0 0 | 2 | not a whole number
100 1 0 0 0 | 100 0 0 0 0 | 2 | out of range
100 1 0 0 0 | 100 1 128 0 0 | 2 | out of range
approximate 100 1 0 0 0\n |  | 2 | expected a `approximate` record";

#[test]
fn malformed_files_are_refused_with_their_line() {
    let tables = [
        (EXACT, EXACT_MALFORMED),
        (APPROXIMATE, APPROXIMATE_MALFORMED),
    ];
    for (text, row) in rows(&tables) {
        let row = row.replace(r"\n", "\n");
        let [from, to, line, reason] = split(&row);
        assert!(text.contains(from), "{from}");
        let malformed = parse(&text.replacen(from, to, 1)).expect_err(to);
        assert_eq!(malformed.line.to_string(), line, "{to}: {malformed}");
        assert!(malformed.reason.contains(reason), "{to}: {malformed}");
    }
    assert_eq!(parse("").expect_err("no case").line, 1);
}
