//! Where `unsafe` may stand, and a search for it anywhere else.
//!
//! The search reads tokens, not text: comments, strings and characters are
//! skipped, and `unsafe` must stand as a word of its own, so neither this
//! page nor `unsafe_code` counts.

use std::fs;
use std::path::PathBuf;

use crate::system;

/// The places, each with its reason; a folder ends in a slash.
const PLACES: &[(&str, &str)] = &[
    (
        "boot/entry/src/",
        "from the reset to Rust, there is nothing safe to stand on",
    ),
    (
        "boot/src/physical.rs",
        "what the loader left is at addresses, not in references",
    ),
    (
        "kernel/src/machine/",
        "registers, ports, interrupts, page tables",
    ),
    ("kernel/src/memory/", "the allocator hands out raw memory"),
    (
        "kernel/src/entry.rs",
        "the symbols that an image must define",
    ),
    (
        "kernel/src/start.rs",
        "the entry's way up to the first safe state",
    ),
    ("fass/src/cell.rs", "the job slots' one cell type"),
    ("fass/tests/no_allocation.rs", "an allocator that counts"),
    ("sched-dag/tests/allocation.rs", "an allocator that counts"),
    ("apps/faults/src/crimes.rs", "what the processor must stop"),
    (
        "tests/guest/src/kernel_crimes.rs",
        "what the kernel must report",
    ),
];

/// Finds `unsafe` outside its places.
pub(super) fn check(sources: &[PathBuf]) -> Result<(), String> {
    let mut found = Vec::new();
    for path in sources {
        let place = path.strip_prefix(system::workspace()).unwrap_or(path);
        let place = place.display().to_string();
        if PLACES.iter().any(|(allowed, _)| place.starts_with(allowed)) {
            continue;
        }
        let text = fs::read_to_string(path).map_err(|error| format!("{place}: {error}"))?;
        found.extend(lines_with_unsafe(&text).map(|line| format!("{place}:{line}")));
    }
    if found.is_empty() {
        return Ok(());
    }
    let places: Vec<&str> = PLACES.iter().map(|(place, _)| *place).collect();
    Err(format!(
        "it stands in {}; it may only in {}",
        found.join(", "),
        places.join(", ")
    ))
}

/// Returns the numbers of the lines on which the keyword stands.
fn lines_with_unsafe(text: &str) -> impl Iterator<Item = usize> {
    let code = code_only(text);
    let lines: Vec<bool> = code.lines().map(has_unsafe).collect();
    let numbered = lines.into_iter().enumerate();
    numbered.filter_map(|(index, has)| has.then_some(index + 1))
}

fn has_unsafe(line: &str) -> bool {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    line.split(|c| !is_part(c)).any(|word| word == "unsafe")
}

/// Returns the text with comments and literals left out, line ends kept.
fn code_only(text: &str) -> String {
    let mut code = String::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let skipped = literal_or_comment(rest);
        let (taken, keep) = match skipped {
            0 => (first.len_utf8(), true),
            length => (length, false),
        };
        if keep {
            code.push(first);
        } else {
            code.push(' ');
            code.extend(rest[..taken].chars().filter(|c| *c == '\n'));
        }
        rest = &rest[taken..];
    }
    code
}

/// Returns the length of the comment or literal that `text` begins with; 0 if
/// it begins with neither.
fn literal_or_comment(text: &str) -> usize {
    let until = |end: &str, from: usize| {
        let found = text[from..].find(end);
        found.map_or(text.len(), |at| from + at + end.len())
    };
    if text.starts_with("//") {
        return text.find('\n').unwrap_or(text.len());
    }
    if text.starts_with("/*") {
        return block_comment(text);
    }
    if text.starts_with('"') {
        return quoted(text, '"');
    }
    if let Some(raw) = text.strip_prefix('r') {
        let hashes = raw.len() - raw.trim_start_matches('#').len();
        if raw[hashes..].starts_with('"') {
            let end = format!("\"{}", "#".repeat(hashes));
            return until(&end, hashes + 2);
        }
    }
    let mut characters = text.chars();
    if characters.next() == Some('\'') {
        // A lifetime has no closing quote after its first character.
        let (first, second) = (characters.next(), characters.next());
        if first == Some('\\') || second == Some('\'') {
            return quoted(text, '\'');
        }
    }
    0
}

fn quoted(text: &str, quote: char) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            _ if c == quote => return at + 1,
            _ => {}
        }
    }
    text.len()
}

/// Block comments nest in Rust.
fn block_comment(text: &str) -> usize {
    let mut depth = 0_usize;
    let mut at = 0;
    while at < text.len() {
        if text[at..].starts_with("/*") {
            depth += 1;
            at += 2;
        } else if text[at..].starts_with("*/") {
            depth -= 1;
            at += 2;
            if depth == 0 {
                return at;
            }
        } else {
            at += text[at..].chars().next().map_or(1, char::len_utf8);
        }
    }
    text.len()
}

#[cfg(test)]
mod tests {
    use super::lines_with_unsafe;

    fn lines(text: &str) -> Vec<usize> {
        lines_with_unsafe(text).collect()
    }

    #[test]
    fn the_keyword_is_found_by_its_line() {
        assert_eq!(
            lines("fn f() {\n    unsafe { g() }\n}\nunsafe fn g() {}"),
            [2, 4]
        );
        assert_eq!(lines("#[unsafe(no_mangle)]"), [1]);
        assert_eq!(lines("let c = '\"'; unsafe {}"), [1]);
        assert_eq!(lines("fn f<'a>(x: &'a u8) { unsafe {} }"), [1]);
        assert_eq!(lines("/* a\n/* b */\n*/ unsafe {}"), [3]);
    }

    #[test]
    fn words_that_only_look_like_it_are_not() {
        for text in [
            "// unsafe",
            "/// unsafe { }",
            "/* /* */ unsafe */",
            "let s = \"unsafe \\\" unsafe\";",
            "let s = r#\"a \" unsafe\"#;",
            "#![forbid(unsafe_code)]",
            "#![deny(unsafe_op_in_unsafe_fn)]",
            "let s = \"a\n unsafe\n\";",
        ] {
            assert_eq!(lines(text), [], "{text}");
        }
    }
}
