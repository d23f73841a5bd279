//! Where `unsafe` may stand, and a search for it anywhere else.
//!
//! The search reads tokens, not text: comments, strings and characters are
//! skipped, and `unsafe` must stand as a word of its own, so neither this
//! page nor `unsafe_code` counts.

use std::fs;
use std::path::PathBuf;

use super::code::code_only;
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
