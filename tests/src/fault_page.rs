//! The page `docs/errors.md`, as the tests read it: tests compare a commit's text for each fault
//! with the page word for word, so the page cannot go stale.
//!
//! A fault's *entry* is a row of a table with the head `| fault | text |` and a third column: the
//! name in backquotes, the text, and notes.

use std::collections::BTreeMap;

use lab::golden;

use crate::markdown::page;

const PAGE: &str = "docs/errors.md";

/// Reads the page: the text of each fault by the fault's name.
///
/// # Panics
///
/// Panics if the page has no entries, or if an entry lacks a part or occurs twice.
pub fn documented_faults() -> BTreeMap<String, String> {
    read(&page(PAGE)).unwrap_or_else(|why| panic!("{PAGE}: {why}"))
}

/// Reads the first column of a table of the page. `head` is the head of the first column and of the
/// columns behind it. In the cells `...` replaces varying parts.
///
/// # Panics
///
/// Panics if the page has no such table.
pub fn table(head: &str) -> Vec<String> {
    let page = page(PAGE);
    let rows = page.split(head).nth(1).expect(head);
    let rows = rows.trim_start().lines().skip(1);
    let texts = rows.take_while(|row| row.starts_with("| "));
    let texts = texts.filter_map(|row| row.split('|').nth(1));
    texts.map(|text| text.trim().to_string()).collect()
}

/// Compares the text of a fault's entry with the present text.
///
/// # Panics
///
/// Panics if the texts differ; see [`golden::assert_is`].
#[track_caller]
pub fn assert_is(fault: &str, text: &str, now: &str) {
    golden::assert_is(PAGE, &format!("\n| `{fault}` | "), text, now);
}

/// Returns a fault's text with another text's names, in backquotes.
pub fn with_names_of(other: &str, text: &str) -> String {
    let mut names = other.split('`').skip(1).step_by(2);
    let parts = text
        .split('`')
        .enumerate()
        .map(|(index, part)| match index % 2 {
            0 => part,
            _ => names.next().unwrap_or(part),
        });
    parts.collect::<Vec<_>>().join("`")
}

fn read(page: &str) -> Result<BTreeMap<String, String>, String> {
    let mut faults = BTreeMap::new();
    for table in page.split("\n| fault | text |").skip(1) {
        let rows = table.lines().skip(2);
        for row in rows.take_while(|row| row.starts_with('|')) {
            let cells: Vec<&str> = row.split('|').map(str::trim).collect();
            let &["", name, text, _, ""] = &cells[..] else {
                return Err(format!("a row without three cells: {row}"));
            };
            let name = name.trim_matches('`');
            if name.is_empty() || text.is_empty() {
                return Err(format!("an empty cell: {row}"));
            }
            if faults.insert(name.into(), text.into()).is_some() {
                return Err(format!("`{name}` stands there twice"));
            }
        }
    }
    if faults.is_empty() {
        return Err("the page has no entry".into());
    }
    Ok(faults)
}
