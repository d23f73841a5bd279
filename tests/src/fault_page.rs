//! The page `docs/errors.md`, as the tests read it: what a commit says of each
//! fault, and the code that has the fault, are compared with it word for word, so it
//! cannot go stale.
//!
//! A fault's *entry* is headed by its name in backquotes. It has a cause, the text
//! as an indented line, a remedy, and a block of Rust, in this order.

use std::collections::BTreeMap;

use tool::golden::Golden;

use crate::markdown::{blocks, page};

const PAGE: &str = "docs/errors.md";

/// What the page says of one fault.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// The commit's text.
    pub text: String,
    /// The code that has the fault.
    pub example: String,
}

/// Reads the page: the entry of each fault by the fault's name.
///
/// # Panics
///
/// Panics if the page has no entries, or if one lacks a part.
#[must_use]
pub fn documented_faults() -> BTreeMap<String, Entry> {
    read(&page(PAGE)).unwrap_or_else(|why| panic!("{PAGE}: {why}"))
}

/// Reads the first column of one of the page's tables, which is found by the head of
/// that column and the columns behind it; `...` stands for what varies.
///
/// # Panics
///
/// Panics if the page has no such table.
#[must_use]
pub fn table(head: &str) -> Vec<String> {
    let page = page(PAGE);
    let rows = page.split(head).nth(1).expect(head);
    let rows = rows.trim_start().lines().skip(1);
    let texts = rows
        .take_while(|row| row.starts_with("| "))
        .filter_map(|row| row.split('|').nth(1));
    texts.map(|text| text.trim().to_string()).collect()
}

/// Whether a text is what a pattern with `...` says.
#[must_use]
pub fn is_said_by(text: &str, pattern: &str) -> bool {
    let mut rest = text;
    for part in pattern.split("...") {
        match rest.find(part) {
            Some(place) => rest = &rest[place + part.len()..],
            None => return false,
        }
    }
    rest.is_empty()
}

/// Returns the bodies of a source's functions without arguments, by their names,
/// without the indentation.
#[must_use]
pub fn function_bodies(source: &str) -> BTreeMap<String, String> {
    let mut bodies = BTreeMap::new();
    let mut open: Option<(String, String)> = None;
    for line in source.lines() {
        match open.as_mut() {
            None => {
                let function = line.strip_prefix("pub(super) ").unwrap_or(line);
                let name = function
                    .strip_prefix("fn ")
                    .filter(|rest| rest.ends_with('{'))
                    .and_then(|rest| rest.split_once("()"));
                open = name.map(|(name, _)| (name.into(), String::new()));
            }
            Some(_) if line == "}" => bodies.extend(open.take()),
            Some((_, body)) => {
                *body += line.strip_prefix("    ").unwrap_or(line);
                body.push('\n');
            }
        }
    }
    bodies
}

/// Holds a part of a fault's entry, its text or its example, to what it is now.
///
/// # Panics
///
/// Panics if it is another; see [`Golden::assert_is`].
#[track_caller]
pub fn assert_is(fault: &str, part: &str, now: &str) {
    let golden = Golden {
        file: PAGE,
        below: &format!("\n### `{fault}`\n"),
        text: part,
    };
    golden.assert_is(now);
}

/// Returns a fault's text with the names, in backquotes, that another text has.
#[must_use]
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

fn read(page: &str) -> Result<BTreeMap<String, Entry>, String> {
    let sections = page.split("\n### `").skip(1);
    let named = |section: &str| {
        let (fault, rest) = section.split_once('`').ok_or("a heading without end")?;
        let rest = rest.split("\n## ").next().unwrap_or(rest);
        let entry = read_entry(rest).map_err(|lack| format!("`{fault}` lacks its {lack}"))?;
        Ok((fault.to_string(), entry))
    };
    let faults: BTreeMap<String, Entry> = sections.map(named).collect::<Result<_, String>>()?;
    if faults.is_empty() {
        return Err("the page has no entry".into());
    }
    Ok(faults)
}

/// Reads what stands below an entry's heading, or says which part it lacks.
fn read_entry(section: &str) -> Result<Entry, &'static str> {
    let (cause, rest) = section.split_once("\n    ").ok_or("text")?;
    let (text, rest) = rest.split_once('\n').ok_or("remedy")?;
    let (remedy, _) = rest.split_once("```rust").ok_or("example")?;
    if cause.trim().is_empty() {
        return Err("cause");
    }
    if remedy.trim().is_empty() {
        return Err("remedy");
    }
    let example = blocks(section).into_iter().next().ok_or("example")?;
    Ok(Entry {
        text: text.into(),
        example: example.text,
    })
}

#[cfg(test)]
mod tests {
    use super::{function_bodies, is_said_by, read, with_names_of};

    const ENTRY: &str = "# Errors\n\n### `cycle`\n\nA circle.\n\n    a -> b; cut it\n\n\
                         Cut it.\n\n```rust\nlet dag = cycle();\n```\n\n## More\n";

    #[test]
    fn an_entry_has_a_cause_a_text_a_remedy_and_code() {
        let faults = read(ENTRY).unwrap();
        assert_eq!(faults["cycle"].text, "a -> b; cut it");
        assert_eq!(faults["cycle"].example, "let dag = cycle();\n");
        for (part, lack) in [
            ("A circle.\n", "cause"),
            ("    a -> b; cut it\n", "text"),
            ("Cut it.\n", "remedy"),
            ("```rust\nlet dag = cycle();\n```\n", "example"),
        ] {
            let error = read(&ENTRY.replace(part, "")).unwrap_err();
            assert_eq!(error, format!("`cycle` lacks its {lack}"));
        }
    }

    #[test]
    fn bodies_are_those_of_functions_without_arguments() {
        let source = "pub(super) fn a() -> u8 {\n    if true {\n        1\n    }\n}\n\
                      fn b(x: u8) {\n    x\n}\n";
        let bodies = function_bodies(source);
        assert_eq!(bodies.len(), 1);
        assert_eq!(bodies["a"], "if true {\n    1\n}\n");
    }

    #[test]
    fn names_are_those_of_the_other_text() {
        let text = with_names_of("an older `a` and `b` text", "dag `x` has `y`; cut it");
        assert_eq!(text, "dag `a` has `b`; cut it");
    }

    #[test]
    fn a_pattern_says_what_differs_only_at_its_dots() {
        assert!(is_said_by(
            "dag `a` is late; hurry",
            "dag ... is late; hurry"
        ));
        assert!(!is_said_by("dag `a` is late; hurry", "dag ... is late"));
        assert!(!is_said_by("dag `a` is early", "dag ... is late"));
    }
}
