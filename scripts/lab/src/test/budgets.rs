//! Budgets of lines: a crate may grow beyond its budget only if something else shrinks.
//!
//! A *row* of the table is a folder with a `Cargo.toml`, without nested packages; files outside all
//! packages belong to the row of their top folder, such as `scripts`. Counted are lines of Rust,
//! assembly, C, Python, shell and browser pages, except blank lines and lines with only a comment.
//! Tests are counted separately: files in a folder `tests` or called `tests.rs`, and modules below
//! `#[cfg(test)]`. `--bless` sets each budget to the present count, lower or higher. The row `all`
//! is a ceiling on the sums, raised only by a person. Proofs have a row of their own outside the
//! sums, with comments counted. The check [`escape`] makes sure that counted files have the default
//! format, that Rust and assembly are only in counted files, and that product code is not named
//! like a test.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::mem;
use std::path::Path;

use super::{SourceFile, none_of};
use crate::golden::GoldenText;
use tool::system::workspace;

/// The table's path from the workspace's root.
const TABLE: &str = "tests/baselines/lines.txt";

/// The endings of counted files. Timelines kept as data count as tests: their ending goes here.
const ENDINGS: [&str; 8] = [".rs", ".s", ".c", ".py", ".sh", ".js", ".html", ".css"];

/// The row of proofs, including their program and script.
const PROOFS: &str = "sched-dag/proofs";

/// The row of the ceiling.
const ALL: &str = "all";

/// Lines of code and of tests, by the row's name.
type LineCounts = BTreeMap<String, [usize; 2]>;

/// Compares the given files with the table. Rewrites the table if there is a `list` of rewritten
/// files.
pub(super) fn check(sources: &[SourceFile], list: Option<&Path>) -> Result<(), String> {
    let table = fs::read_to_string(workspace().join(TABLE));
    let table = table.map_err(|error| format!("{TABLE}: {error}"))?;
    let (budgets, mut there) = (read(&table), count(sources));
    let (file, below, text) = (TABLE, "", &*table);
    let summed = there.iter().filter(|(row, _)| *row != PROOFS);
    let sum = |index: usize| summed.clone().map(|(_, lines)| lines[index]).sum();
    let sums = [sum(0), sum(1)];
    there.insert(ALL.into(), sums);
    if list.is_some() {
        let mut blessed = there.clone();
        blessed.extend(
            budgets
                .get_key_value(ALL)
                .map(|(row, all)| (row.clone(), *all)),
        );
        GoldenText { file, below, text }.compare(&write(&blessed), list)?;
        return none_of(complaints(&blessed, &there));
    }
    none_of(complaints(&budgets, &there))
}

fn read(table: &str) -> LineCounts {
    let row = |line: &str| {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [name, code, tests] = words[..] else {
            return None;
        };
        Some((name.into(), [code.parse().ok()?, tests.parse().ok()?]))
    };
    table.lines().filter_map(row).collect()
}

fn write(rows: &LineCounts) -> String {
    let rows = rows.iter();
    let rows = rows.map(|(row, [code, tests])| format!("{row:20} {code:>7} {tests:>7}\n"));
    format!("{:20} {:>7} {:>7}\n", "crate", "code", "tests") + &rows.collect::<String>()
}

fn complaints(budgets: &LineCounts, there: &LineCounts) -> Vec<String> {
    let mut complaints = Vec::new();
    for row in budgets.keys().chain(there.keys()).collect::<BTreeSet<_>>() {
        // A row on one side only: a crate is new, or gone.
        let (Some(budget), Some(lines)) = (budgets.get(row), there.get(row)) else {
            complaints.push(format!(
                "`{row}` is not both in {TABLE} and in the tree; bless it"
            ));
            continue;
        };
        for (what, index) in [("code", 0), ("tests", 1)] {
            if let Some(more @ 1..) = lines[index].checked_sub(budget[index]) {
                complaints.push(format!(
                    "{row} has {more} lines of {what} more than its budget; remove as much, or raise \
                     the number in {TABLE} and say in the commit what went instead"
                ));
            }
        }
    }
    complaints
}

fn count(sources: &[SourceFile]) -> LineCounts {
    let mut rows = LineCounts::new();
    for SourceFile { name, text } in sources {
        let path = Path::new(name);
        // Scripts of the shell in `scripts/` have no ending.
        let is_script = name.starts_with("scripts/") && path.extension().is_none();
        let is_proof =
            name.starts_with(PROOFS) && !name.ends_with(".md") && !name.ends_with(".txt");
        if !is_proof && !is_script && !ENDINGS.iter().any(|ending| name.ends_with(ending)) {
            continue;
        }
        let is_package = |folder: &&Path| workspace().join(folder).join("Cargo.toml").is_file();
        let package = path.ancestors().skip(1).find(is_package);
        let first = || path.iter().next().map(Path::new);
        let row = package
            // The workspace's own manifest makes no row of the whole tree.
            .filter(|folder| folder.parent().is_some())
            .or_else(first);
        let row = row.map_or(String::new(), |row| row.display().to_string());
        let row = if is_proof { PROOFS.into() } else { row };
        let [code, tests] = lines(name, text);
        let sum = rows.entry(row).or_default();
        *sum = [sum[0] + code, sum[1] + tests];
    }
    rows
}

/// Counts the lines of code and of tests in a file.
fn lines(name: &str, text: &str) -> [usize; 2] {
    let comment = match name.rsplit_once('.') {
        Some((_, "rs" | "c" | "js" | "css")) => "//",
        Some((_, "py" | "sh")) => "#",
        // No line begins with a line end: in other files comments are counted.
        _ => "\n",
    };
    let mut counts = [0, 0];
    // The line that ends the module below `#[cfg(test)]`, if one is open.
    let mut end: Option<String> = None;
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        let trimmed = line.trim();
        let next = lines.peek().map_or("", |next| next.trim());
        let is_module = next.trim_start_matches("pub ").starts_with("mod ") && next.ends_with('{');
        if trimmed.starts_with("#[cfg(test)]") && is_module {
            // The closing brace at the same indentation, as the default format writes it.
            end = Some(line.replace(trimmed, "}"));
        }
        if !trimmed.is_empty() && !trimmed.starts_with(comment) {
            counts[usize::from(is_test(name) || end.is_some())] += 1;
        }
        end = end.filter(|end| !line.starts_with(end));
    }
    counts
}

fn is_test(name: &str) -> bool {
    name.starts_with("tests/") || name.contains("/tests/") || name.ends_with("tests.rs")
}

/// Finds text in a source or settings file that makes lines escape the count, or count as tests
/// wrongly.
pub(super) fn escape(name: &str, text: &str) -> Option<String> {
    if !name.ends_with(".rs") && !name.ends_with(".toml") {
        return None;
    }
    let lines = || text.lines().map(str::trim);
    // Text in quotation marks only looks like code.
    let code = || lines().filter(|line| !line.starts_with("//"));
    let has =
        |word: &str| code().any(|line| line.split('"').step_by(2).any(|part| part.contains(word)));
    let words = ["rustfmt::skip", "rustfmt_skip", "include!"];
    let word = words.into_iter().find(|word| has(word));
    let format = name.ends_with("rustfmt.toml").then_some("a format");
    let mut texts = text.split("include_str!(\"").skip(1);
    let is_odd = |text: &str| !text.split('"').take(1).all(|file| file.ends_with(".s"));
    let assembly = (has("asm!(") && texts.any(is_odd)).then_some("assembly");
    let mut above = "";
    let line = lines().find(|line| {
        // The attribute stands right above its module.
        let is_test_only = mem::replace(&mut above, line) == "#[cfg(test)]";
        let is_module = line.ends_with("tests;") && line.contains("mod ");
        let starts = ["#[path = \"", "path = \"", "build = \""];
        let file = starts
            .iter()
            .find_map(|start| line.strip_prefix(start)?.split('"').next());
        file.is_some_and(|file| !file.ends_with(".rs") || is_test(file) && !is_test(name))
            || is_module && !is_test_only && !is_test(name)
    });
    let what = word.or(format).or(assembly).or(line)?;
    Some(format!("has `{what}`, by which lines escape the budgets"))
}

#[cfg(test)]
mod tests {
    use super::{LineCounts, complaints, escape, lines, read, write};

    /// A source with `@` for `#[cfg(test)]`: written out, the attribute would seem to end this
    /// module early.
    const SOURCE: &str = "
        //! Essay.
        use a::b; // code

        // A comment alone.
        @
        use a::c;
        mod inner {
            @
            pub mod tests {
                //! Essay.
                fn test() {}
            }
            fn code() {}
        }
        @
        mod tests {
            const TEXT: &str = \"
                }
        \";
        }
        fn code_again() {}
    ";

    #[test]
    fn code_is_told_from_tests_comments_and_blanks() {
        let source = SOURCE.replace('@', "#[cfg(test)]");
        let source = source.replace("\n        ", "\n");
        let script = "#!/bin/sh\n# Says\n\necho \\\n    // # hello\n";
        for (name, text, counts) in [
            ("a/src/lib.rs", &*source, [7, 10]),
            ("a/tests/b.rs", &source, [0, 17]),
            ("tests/b.rs", &source, [0, 17]),
            ("a/src/tests.rs", &source, [0, 17]),
            ("a/src/b_tests.rs", &source, [0, 17]),
            ("scripts/a.sh", script, [2, 0]),
            // Files without ending, and assembly, are counted with their comments.
            ("scripts/a", script, [4, 0]),
            ("a/src/b.s", script, [4, 0]),
            ("a/src/b.c", script, [3, 0]),
        ] {
            assert_eq!(lines(name, text), counts, "{name}");
        }
    }

    #[test]
    fn a_table_is_read_back_and_what_is_beyond_it_is_named_with_the_remedy() {
        let rows = |table: &str| read(&table.replace("; ", "\n"));
        let budgets = rows("fass 10 20; gone 1 1; kernel 5 5");
        let there = rows("fass 13 20; kernel 5 4; new 1 0");
        assert_eq!(budgets.len(), 3);
        let table = "tests/baselines/lines.txt";
        let stray = |row| format!("`{row}` is not both in {table} and in the tree; bless it");
        let more = format!(
            "fass has 3 lines of code more than its budget; remove as much, or raise the number in \
             {table} and say in the commit what went instead"
        );
        let expected = [more, stray("gone"), stray("new")];
        assert_eq!(complaints(&budgets, &there), expected);
        let written = write(&there);
        assert_eq!(read(&written), there);
        let head = "crate                   code   tests\nfass ";
        assert!(written.starts_with(head), "{written}");
        assert_eq!(read(""), LineCounts::new());
    }

    /// Files, their texts, and the part letting lines escape the count. `~` ends a line. To hide
    /// the rows from the check of this very file, `^` stands for `!` and `%` for `rustfmt`.
    const ESCAPES: &str = r#"rustfmt.toml |  | a format
a/src/b.rs | #[%::skip]~fn f() {} | %::skip
a/src/b.rs | #[cfg_attr(all(), %::skip)]~fn f() {} | %::skip
a/src/b.rs | include^("c.txt"); | include^
a/src/b.rs | global_asm^(include_str!("c.txt")); | assembly
a/src/b.rs | #[path = "c.txt"]~mod c; | #[path = "c.txt"]
a/src/b.rs |   #[path = "@c.rs"]~  mod c; | #[path = "@c.rs"]
a/Cargo.toml | [lib]~path = "@c.rs" | path = "@c.rs"
a/src/b.rs | pub(crate) mod latests; | pub(crate) mod latests; |
a/src/b.rs | // include^ | nothing
a/src/b.rs | const A: &str = "include^"; | nothing
a/src/b.rs | global_asm^(include_str!("c.s"));~#[cfg(test)]~mod tests; | nothing
a/tests/b.rs | #[path = "@c.rs"]~mod c; | nothing
a/Cargo.toml | c = { path = "tests" } | nothing
docs/a.md | include^("c.txt"); | nothing"#;

    #[test]
    fn what_would_escape_the_count_is_named() {
        for row in ESCAPES.lines() {
            let mut cells = row.split('|').map(str::trim);
            let [name, text, what] = [(); 3].map(|()| cells.next().expect(row));
            let [text, what] = [text.replace('~', "\n"), what.into()];
            let meant = |cell: String| cell.replace('^', "!").replace('%', "rustfmt");
            let [text, what] = [text, what].map(|cell| meant(cell).replace('@', "tests/"));
            let expected = format!("has `{what}`, by which lines escape the budgets");
            let expected = (what != "nothing").then_some(expected);
            assert_eq!(escape(name, &text), expected, "{row}");
        }
    }
}
