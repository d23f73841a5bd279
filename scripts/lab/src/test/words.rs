//! Words: the countable part of the house rules on names and sentences.
//!
//! - A doc sentence says what an item is or does, and never begins with a question word.
//! - No two types of a crate share a name, and no type is called by a question word or a pronoun.
//! - Sentences with nouns need no second reading: in no room do pronouns become more frequent, and
//!   the words of all pages do not exceed a ceiling, raised only by a person.
//!
//! A *room* is a top folder, a crate of the kernel, a first page, or all other pages of `docs/`
//! together. Types of tests and examples, and types within functions and inline modules, are
//! exempt.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use super::{SourceFile, none_of};
use crate::golden::GoldenText;
use tool::system::workspace;

/// The path of the table of rooms, from the workspace's root.
const TABLE: &str = "tests/baselines/words.txt";

/// The row of the ceiling of words.
const PAGES: &str = "docs/*.md";

/// The pages a user reads first, each a room of its own.
const FIRST_PAGES: [&str; 3] = ["README.md", "docs/guide.md", "docs/commands.md"];

/// The row of all other pages of `docs/`.
const OTHER_PAGES: &str = "docs/others";

/// The counted words, which stand for nouns.
const COUNTED: [&str; 5] = ["what", "that", "which", "it", "one"];

/// The words forbidden at the beginning of a doc line.
const QUESTIONS: [&str; 5] = ["What ", "That which ", "Whatever ", "Who ", "Whoever "];

/// The words forbidden as type names.
const PRONOUNS: [&str; 11] = [
    "What", "Why", "Who", "Whose", "Which", "When", "Where", "How", "Of", "By", "Me",
];

/// Returns a complaint with the numbers of the doc lines beginning with a question word.
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

/// Checks the names of types against the rules.
///
/// # Errors
///
/// In words: the offending names and their places.
pub(super) fn check_names(sources: &[SourceFile]) -> Result<(), String> {
    let manifests = sources.iter().map(|it| it.name.as_str());
    let crates = manifests.filter_map(|name| name.strip_suffix("Cargo.toml"));
    let crates: Vec<&str> = crates.collect();
    let mut places = BTreeMap::<(&str, &str), Vec<&str>>::new();
    let mut faults = Vec::new();
    for SourceFile { name, text } in sources {
        let of_tests = ["tests/", "tests.rs", "examples/", "template/"];
        if !name.ends_with(".rs") || of_tests.iter().any(|part| name.contains(part)) {
            continue;
        }
        // A crate may lie inside another: the longest matching folder is the file's own crate.
        let within = crates.iter().filter(|folder| name.starts_with(**folder));
        let own = within.max_by_key(|folder| folder.len()).unwrap_or(&"");
        for type_name in text.lines().filter_map(type_name) {
            places.entry((*own, type_name)).or_default().push(name);
            if PRONOUNS.contains(&type_name) {
                let remedy = "name it by a noun";
                faults.push(format!("{name} has a type `{type_name}`; {remedy}"));
            }
        }
    }
    for ((_, type_name), places) in places {
        if places.len() > 1 {
            let places = places.join(", ");
            let remedy = "rename all but one";
            faults.push(format!(
                "`{type_name}` is a type in each of {places}; {remedy}"
            ));
        }
    }
    none_of(faults)
}

/// Compares the pronouns and words with the table. Given a `list` of rewritten files, rewrites the
/// table, lowering the limits of rooms with fewer pronouns than allowed.
///
/// # Errors
///
/// In words: the rooms above their limits.
pub(super) fn check_rooms(sources: &[SourceFile], list: Option<&Path>) -> Result<(), String> {
    let table = fs::read_to_string(workspace().join(TABLE));
    let table = table.map_err(|error| format!("{TABLE}: {error}"))?;
    let rows = table.lines().filter_map(|line| {
        let (room, most) = line.split_once(' ')?;
        Some((room.to_owned(), most.trim().parse().ok()?))
    });
    let most: BTreeMap<String, usize> = rows.collect();
    let there = rooms(sources);
    if list.is_some() {
        let lower = |(room, count): (&String, &usize)| {
            let most = most.get(room).copied().unwrap_or(*count);
            let least = if room == PAGES {
                most
            } else {
                most.min(*count)
            };
            format!("{room:20} {least:>7}\n")
        };
        let head = format!("{:20} {:>7}\n", "room", "most");
        let said = head + &there.iter().map(lower).collect::<String>();
        let (file, below, text) = (TABLE, "", &*table);
        GoldenText { file, below, text }.compare(&said, list)?;
    }
    let over = there.iter().filter_map(|(room, count)| {
        let Some(&most) = most.get(room) else {
            let line = format!("`{room}` is not in {TABLE}; bless it");
            return list.is_none().then_some(line);
        };
        (*count > most).then(|| match room == PAGES {
            true => format!("{room} have {count} words, {most} are allowed; shorten a page"),
            false => format!(
                "{room} has {count} of `{}` in 1,000 words, {most} are allowed; say nouns",
                COUNTED.join("`, `")
            ),
        })
    });
    none_of(over.collect())
}

/// Counts the pronouns in 1,000 words of documentation, for each top folder, each crate of the
/// kernel, each first page and all other pages, and the words of all pages of `docs/`.
fn rooms(sources: &[SourceFile]) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::<String, [usize; 2]>::new();
    let mut words = 0;
    for SourceFile { name, text } in sources {
        let is_page = name.ends_with(".md");
        let below_docs = name.strip_prefix("docs/");
        let is_in_docs = is_page && below_docs.is_some_and(|page| !page.contains('/'));
        words += text.split_whitespace().count() * usize::from(is_in_docs);
        let is_first = FIRST_PAGES.contains(&&**name);
        if is_first || is_in_docs {
            let room = if is_first { name } else { OTHER_PAGES };
            count(text.lines(), counts.entry(room.into()).or_default());
        }
        let is_code =
            name.ends_with(".rs") && !name.contains("/tests") && !name.ends_with("tests.rs");
        let docs = text.lines().map(str::trim_start);
        let docs = docs.filter_map(|line| line.strip_prefix("///").or(line.strip_prefix("//!")));
        // The kernel's crates are rooms of their own, and of the kernel.
        let ends = name.match_indices('/').map(|(end, _)| &name[..end]);
        let deepest = 1 + usize::from(name.starts_with("kernel/"));
        for room in ends.take(deepest * usize::from(is_code)) {
            count(docs.clone(), counts.entry(room.into()).or_default());
        }
    }
    let rate = |(room, [pronouns, all]): (String, [usize; 2])| {
        (room, (pronouns * 1000).div_ceil(all.max(1)))
    };
    let mut rooms: BTreeMap<_, _> = counts.into_iter().map(rate).collect();
    rooms.insert(PAGES.into(), words);
    rooms
}

/// Adds up the pronouns and words of the given lines, without code blocks and names of code.
fn count<'t>(lines: impl Iterator<Item = &'t str>, [pronouns, all]: &mut [usize; 2]) {
    let mut is_code = false;
    for line in lines {
        let is_fence = line.trim_start().starts_with("```");
        is_code ^= is_fence;
        if is_code || is_fence {
            continue;
        }
        for part in line.split('`').step_by(2) {
            let words = part.split(|letter: char| !letter.is_ascii_alphabetic() && letter != '\'');
            for word in words.filter(|word| !word.is_empty()) {
                *all += 1;
                *pronouns += usize::from(COUNTED.contains(&&*word.to_ascii_lowercase()));
            }
        }
    }
}

/// Returns the name of the type defined by a line at the top level of a file, if any.
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
    use super::{asks, check_names, rooms};
    use crate::test::made::file;

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
    fn pronouns_are_counted_by_room_and_words_of_pages_together() {
        let file = |name: &str, text: &str| file(name, &text.replace('@', "//"));
        let counted = rooms(&[
            file(
                "fass/src/a.rs",
                "@/ The core that waits.\n@! ```\n@! it it\n@! ```\nlet it;\n",
            ),
            file("fass/tests/a.rs", "@/ It.\n"),
            file(
                "docs/guide.md",
                "It runs, `that one` too.\n```\nwhat\n```\n",
            ),
            file("docs/decisions/1.md", "It.\n"),
            file("docs/linux.md", "It runs.\n"),
            file("kernel/net/src/a.rs", "@/ The frame.\n"),
        ]);
        let row = |room: &str, count: usize| (room.to_owned(), count);
        let expected = [
            row("docs/*.md", 10),
            row("docs/guide.md", 334),
            row("docs/others", 500),
            row("fass", 250),
            row("kernel", 0),
            row("kernel/net", 0),
        ];
        assert_eq!(counted, expected.into());
    }

    #[test]
    fn types_of_one_crate_that_share_a_name_and_pronouns_are_told() {
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
