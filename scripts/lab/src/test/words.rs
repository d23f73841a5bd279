//! Words: those of the house's rules on names and sentences that can be counted.
//!
//! - A doc sentence says what a thing is or does; none begins with a question word.
//! - No two types of a crate share a name, and none is called by a question word or a pronoun.
//!
//! Types of tests and examples, and those within functions and inline modules, are let be.

use std::collections::BTreeMap;

use super::{SourceFile, none_of};

/// The words that begin no doc sentence at the beginning of a line.
const QUESTIONS: [&str; 5] = ["What ", "That which ", "Whatever ", "Who ", "Whoever "];

/// The words that name no type.
const PRONOUNS: [&str; 11] = [
    "What", "Why", "Who", "Whose", "Which", "When", "Where", "How", "Of", "By", "Me",
];

/// Says at which lines a doc sentence begins with a question word.
pub(super) fn asks(name: &str, text: &str) -> Option<String> {
    if !name.ends_with(".rs") {
        return None;
    }
    let asks = |line: &str| {
        let line = line.trim_start();
        let doc = ["/// ", "//! "].iter().find_map(|it| line.strip_prefix(it));
        doc.is_some_and(|doc| QUESTIONS.iter().any(|word| doc.starts_with(word)))
    };
    let lines = (1..).zip(text.lines()).filter(|(_, line)| asks(line));
    let lines: Vec<String> = lines.map(|(line, _)| format!("{line}")).collect();
    (!lines.is_empty()).then(|| {
        let lines = lines.join(", ");
        format!("asks in line {lines}; say what the item is or does")
    })
}

/// Holds the names of types against the rules.
///
/// # Errors
///
/// In words: which names, and where.
pub(super) fn check_names(sources: &[SourceFile]) -> Result<(), String> {
    let manifests = sources.iter().map(|it| it.name.as_str());
    let crates: Vec<&str> = manifests
        .filter_map(|name| name.strip_suffix("Cargo.toml"))
        .collect();
    let mut places = BTreeMap::<(&str, &str), Vec<&str>>::new();
    let mut faults = Vec::new();
    for SourceFile { name, text } in sources {
        let of_tests = ["tests/", "tests.rs", "examples/", "template/"];
        if !name.ends_with(".rs") || of_tests.iter().any(|part| name.contains(part)) {
            continue;
        }
        // A crate may lie in another one: the longest folder is the file's own.
        let within = crates.iter().filter(|folder| name.starts_with(**folder));
        let own = within.max_by_key(|folder| folder.len()).unwrap_or(&"");
        for type_name in text.lines().filter_map(type_name) {
            places.entry((*own, type_name)).or_default().push(name);
            if PRONOUNS.contains(&type_name) {
                faults.push(format!(
                    "{name} has a type `{type_name}`; name it by a noun"
                ));
            }
        }
    }
    for ((_, type_name), places) in places {
        if places.len() > 1 {
            let places = places.join(", ");
            faults.push(format!(
                "`{type_name}` is a type in each of {places}; rename all but one"
            ));
        }
    }
    none_of(faults)
}

/// Returns the name of the type that a line at the top level of a file defines, if it does.
fn type_name(line: &str) -> Option<&str> {
    let mut words = line.split([' ', '<', '(', ';', ':', '{']);
    if !line.starts_with(|first: char| first.is_ascii_lowercase()) {
        return None;
    }
    let defines = |word: &&str| ["struct", "enum", "trait", "type", "union"].contains(word);
    // Between the line's start and the word are visibility and `unsafe` only.
    let before = |word: &&str| word.starts_with("pub") || *word == "unsafe" || word.ends_with(')');
    words.find(|word| !before(word)).filter(defines)?;
    words.next()
}

#[cfg(test)]
mod tests {
    use super::{asks, check_names};
    use crate::test::SourceFile;

    #[test]
    fn a_doc_sentence_that_asks_is_told_with_its_line() {
        let text = format!(
            "{0}/ A core.\n    {0}/ What it does.\n// What for\n{0}! Whatnot.\n",
            "//"
        );
        let said = asks("core.rs", &text);
        assert_eq!(
            said.as_deref(),
            Some("asks in line 2; say what the item is or does")
        );
        assert_eq!(asks("core.md", &text), None);
    }

    #[test]
    fn types_of_one_crate_that_share_a_name_and_pronouns_are_told() {
        let file = |name: &str, text: &str| SourceFile {
            name: name.into(),
            text: text.into(),
        };
        let mut sources = vec![
            file("a/Cargo.toml", ""),
            file("a/b/Cargo.toml", ""),
            file(
                "a/src/one.rs",
                "pub struct Graph<T>(T);\n    struct Inner;\n",
            ),
            file("a/b/src/one.rs", "enum Graph {}\n"),
            file("a/src/tests.rs", "struct Graph;\n"),
        ];
        assert_eq!(check_names(&sources), Ok(()));
        sources.push(file(
            "a/src/two.rs",
            "pub(super) trait Graph: Sized {}\npub enum What {}\n",
        ));
        let told = "a/src/two.rs has a type `What`; name it by a noun; `Graph` is a type in each of \
                    a/src/one.rs, a/src/two.rs; rename all but one";
        assert_eq!(check_names(&sources), Err(told.into()));
    }
}
