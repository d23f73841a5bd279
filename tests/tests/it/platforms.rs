//! The table of platforms names tests that exist.

use std::collections::BTreeSet;

use harness::markdown::page;
use scenarios::Scenario;

/// Returns what stands between backquotes.
fn quoted(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

#[test]
fn each_cell_names_a_test_that_is_there_or_a_reason() {
    let text = page("docs/platforms.md");
    let mut keys = BTreeSet::from(["S".to_owned()]);
    for line in text.lines() {
        if let Some((number, test)) = line.split_once(". `") {
            let (file, name) = test.split_once("`: `").expect("a file and a test");
            let test = page(file);
            let name = name.trim_end_matches('`');
            let head = format!("#[test]\nfn {name}() {{");
            assert!(test.contains(&head), "{file} has no test `{name}`");
            keys.insert(number.into());
        }
        let reason = line
            .strip_prefix("- ")
            .and_then(|line| line.split_once(": "));
        keys.extend(reason.map(|(letter, _)| letter.to_owned()));
    }
    let suite = Scenario::suite().expect("scenarios");
    let rows = text.lines().filter(|line| line.starts_with("| "));
    let rows: Vec<Vec<&str>> = rows
        .map(|row| row.trim_matches('|').split('|').map(str::trim).collect())
        .collect();
    assert!(rows.len() > 20, "{rows:?}");
    for row in &rows[1..] {
        let [feature, cells @ .., scenarios] = &row[..] else {
            panic!("{row:?}");
        };
        assert_eq!(cells.len(), 6, "{feature}");
        for cell in cells {
            assert!(keys.contains(*cell), "{feature}: `{cell}`");
        }
        let named: Vec<&str> = quoted(scenarios).collect();
        assert_eq!(cells.contains(&"S"), !named.is_empty(), "{feature}");
        for begin in named {
            let found = suite.iter().any(|it| it.title.starts_with(begin));
            assert!(found, "{feature}: no scenario begins with `{begin}`");
        }
    }
}
