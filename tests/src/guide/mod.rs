//! The tutorials, `docs/guide.md` and `docs/from-ros-2.md`, as the tests read them.
//!
//! A broken tutorial is worse than none, so nothing in them goes unchecked:
//!
//! - their Rust is this crate's doctests (see `lib.rs`), each compiled and run;
//! - their commands must parse by the option tables of the scripts they name;
//! - a boot of a new app must print the output shown in the guide;
//! - a block of any other kind is refused, as is Rust that would not be tested.

use crate::markdown::{blocks, page};

/// The tutorials.
pub const PAGES: [&str; 2] = ["docs/guide.md", "docs/from-ros-2.md"];

/// Returns the output shown by the guide under a name.
///
/// # Panics
///
/// Panics if there is no such block.
pub fn documented_output(name: &str) -> String {
    let info = format!("text output-{name}");
    let mut blocks = blocks(&page(PAGES[0])).into_iter();
    let found = blocks.find(|block| block.info == info);
    found.expect("the guide shows it").text
}

/// Replaces each number by `N`: the rest stays the same when the code becomes faster.
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
