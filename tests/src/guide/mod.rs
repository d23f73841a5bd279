//! The tutorials, `docs/guide.md` and `docs/from-ros-2.md`, as the tests read them.
//!
//! A tutorial that does not work is worse than none, so nothing in them goes
//! unchecked:
//!
//! - their Rust is this crate's doctests (see `lib.rs`), each compiled and run;
//! - their commands are parsed by the tables of the scripts that they name;
//! - what the guide says a new app prints is compared with a boot of one;
//! - a block of any other kind is refused, as is Rust that would not be tested.

use std::fs;

use crate::markdown::blocks;
use tool::system;

/// The tutorials.
pub const PAGES: [&str; 2] = ["docs/guide.md", "docs/from-ros-2.md"];

/// Reads the tutorials, one behind the other.
///
/// # Errors
///
/// In words: a page cannot be read.
pub fn read() -> Result<String, String> {
    let page = |name: &&str| {
        let path = system::workspace().join(name);
        fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))
    };
    PAGES.iter().map(page).collect()
}

/// Returns the output that the guide shows under a name.
///
/// # Errors
///
/// In words: a page cannot be read, or none has such a block.
pub fn documented_output(name: &str) -> Result<String, String> {
    let info = format!("text output-{name}");
    let mut blocks = blocks(&read()?).into_iter();
    let found = blocks.find(|block| block.info == info);
    found
        .map(|block| block.text)
        .ok_or_else(|| format!("docs/guide.md has no block `{info}`"))
}

/// Replaces each number by `N`: what stays the same when the code becomes faster.
#[must_use]
pub fn without_numbers(line: &str) -> String {
    let mut text = String::new();
    for character in line.chars() {
        let in_number = text.ends_with('N');
        match character {
            '0'..='9' if in_number => {}
            '0'..='9' => text.push('N'),
            '.' if in_number => {}
            _ => text.push(character),
        }
    }
    text
}

#[cfg(test)]
mod tests;
