//! Words of a person or of a file, in the form shown by messages.
//!
//! A message repeats the faulty word, and the word may be anything: megabytes without a blank, an
//! escape sequence rewriting the terminal, an invisible byte-order mark. So a message shows only
//! the word's beginning, and replaces each invisible character by its number in Unicode.

use core::fmt::{self, Write};

/// The most characters of a word shown in a message.
const MOST_SHOWN: usize = 40;

/// Returns a word between backquotes, visibly; of a long word only the beginning.
pub fn quoted(word: &str) -> impl fmt::Display {
    fmt::from_fn(move |out| write!(out, "`{}`", shown(word)))
}

/// Returns a word as [`quoted`] does, for a message with backquotes of its own.
pub fn shown(word: &str) -> impl fmt::Display {
    fmt::from_fn(move |out| match word.char_indices().nth(MOST_SHOWN) {
        Some((end, _)) => write!(out, "{}...", visible(&word[..end])),
        None => write!(out, "{}", visible(word)),
    })
}

/// Returns all of a text, with Rust escapes (`\n`, `\u{1b}`, `\u{feff}`) for each character that is
/// invisible, or changes the look of others.
pub fn visible(text: &str) -> impl fmt::Display {
    fmt::from_fn(move |out| {
        text.chars().try_for_each(|character| match character {
            '\n' | '\r' | '\t' => write!(out, "{}", character.escape_default()),
            _ if is_seen(character) => out.write_char(character),
            _ => write!(out, "{}", character.escape_unicode()),
        })
    })
}

/// Reports whether a character is seen as itself: not a control character, not default-ignorable in
/// Unicode, and not changing the direction of text.
pub fn is_seen(character: char) -> bool {
    let is_hidden = matches!(
        character,
        '\u{ad}'
            | '\u{34f}'
            | '\u{61c}'
            | '\u{115f}'..='\u{1160}'
            | '\u{17b4}'..='\u{17b5}'
            | '\u{180b}'..='\u{180f}'
            | '\u{200b}'..='\u{200f}'
            | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}'
            | '\u{3164}'
            | '\u{fe00}'..='\u{fe0f}'
            | '\u{feff}'
            | '\u{ffa0}'
            | '\u{fff0}'..='\u{fffb}'
            | '\u{1d173}'..='\u{1d17a}'
            | '\u{e0000}'..='\u{e0fff}'
    );
    !is_hidden && !character.is_control()
}

#[cfg(test)]
mod tests {
    use super::{quoted, visible};

    #[test]
    fn a_word_is_shown_in_part_if_it_is_long() {
        assert_eq!(quoted("cäse").to_string(), "`cäse`");
        let shown = quoted(&"ä".repeat(1000)).to_string();
        assert_eq!(shown, format!("`{}...`", "ä".repeat(40)));
    }

    #[test]
    fn what_cannot_be_seen_is_shown_by_its_number() {
        for (text, shown) in [
            ("\u{1b}[2J", r"\u{1b}[2J"),
            ("\u{feff}dag", r"\u{feff}dag"),
            ("a\u{202e}b\nc\td", r"a\u{202e}b\nc\td"),
            ("\u{0}\u{7f}\u{9b}", r"\u{0}\u{7f}\u{9b}"),
            ("größe-車 \u{1f680} '\\", "größe-車 \u{1f680} '\\"),
        ] {
            assert_eq!(visible(text).to_string(), shown);
        }
    }
}
