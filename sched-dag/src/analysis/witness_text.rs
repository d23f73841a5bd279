//! The text of a witness: lines of words and numbers.

use alloc::string::String;
use core::fmt::{self, Write};

use super::cover::CoverChain;

pub(super) struct WitnessText(pub(super) String);

impl WitnessText {
    pub(super) fn line(&mut self, words: fmt::Arguments<'_>) {
        // Writing into a `String` cannot fail.
        let _ = writeln!(self.0, "{words}");
    }

    pub(super) fn list(&mut self, word: &str, numbers: impl Iterator<Item = i128>) {
        self.0.push_str(word);
        for number in numbers {
            let _ = write!(self.0, " {number}");
        }
        self.0.push('\n');
    }

    pub(super) fn chains(&mut self, word: &str, chains: &[CoverChain]) {
        for chain in chains {
            let numbers = chain.iter().map(|&(subtask, takes)| {
                let subtask = subtask as i128;
                if takes { subtask } else { -1 - subtask }
            });
            self.list(word, numbers);
        }
    }
}
