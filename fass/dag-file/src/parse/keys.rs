//! The words of a record: its name, then keys, most with a value.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

use text::{Line, Malformed, quoted};

use super::{is_name, no_name};
use crate::time::parse_ns;

/// The words of a record after its name: keys, most with a value.
pub(super) struct Keys<'l, 'a> {
    line: &'l Line<'a>,
    rest: core::slice::Iter<'l, &'a str>,
    seen: Vec<&'a str>,
}

impl<'l, 'a> Keys<'l, 'a> {
    /// Takes the record's name, too.
    pub(super) fn new(line: &'l Line<'a>) -> Result<(String, Self), Malformed> {
        let Some((name, rest)) = line.words.split_first() else {
            return Err(line.malformed(format!("`{}` lacks its name", line.kind)));
        };
        if !is_name(name) {
            return Err(line.malformed(no_name(name)));
        }
        let keys = Self {
            line,
            rest: rest.iter(),
            seen: Vec::new(),
        };
        Ok(((*name).to_string(), keys))
    }

    pub(super) fn next_key(&mut self) -> Result<Option<&'a str>, Malformed> {
        let Some(&key) = self.rest.next() else {
            return Ok(None);
        };
        if self.seen.contains(&key) {
            let message = format!("{} stands here twice; give it once", quoted(key));
            return Err(self.line.malformed(message));
        }
        self.seen.push(key);
        Ok(Some(key))
    }

    /// Takes the next word if it equals `word`.
    pub(super) fn next_if(&mut self, word: &str) -> bool {
        let mut ahead = self.rest.clone();
        let is_it = ahead.next() == Some(&word);
        if is_it {
            self.rest = ahead;
        }
        is_it
    }

    pub(super) fn value(&mut self, key: &str) -> Result<&'a str, Malformed> {
        let value = self.rest.next().copied();
        value.ok_or_else(|| self.line.malformed(format!("`{key}` lacks its value")))
    }

    pub(super) fn time_ns(&mut self, key: &str) -> Result<u64, Malformed> {
        let word = self.value(key)?;
        parse_ns(word).map_err(|message| self.line.malformed(format!("{key}: {message}")))
    }

    /// Reads the WCET of a subtask, or of a segment.
    pub(super) fn wcet_ns(&mut self) -> Result<u64, Malformed> {
        match self.time_ns("wcet")? {
            0 => Err(self
                .malformed("wcet: it is 0, and whatever executes takes time; give at least 1ns")),
            wcet_ns => Ok(wcet_ns),
        }
    }

    pub(super) fn number(&mut self, key: &str) -> Result<u32, Malformed> {
        let word = self.value(key)?;
        self.number_of(key, word)
    }

    /// Reads numbers separated by commas.
    pub(super) fn numbers(&mut self, key: &str) -> Result<Vec<u32>, Malformed> {
        let words = self.value(key)?.split(',');
        words.map(|word| self.number_of(key, word)).collect()
    }

    fn number_of(&self, key: &str, word: &str) -> Result<u32, Malformed> {
        let is_number = word.bytes().all(|byte| byte.is_ascii_digit());
        let number = word.parse().ok().filter(|_| is_number);
        match number {
            Some(number) => Ok(number),
            None => Err(self.line.malformed(format!(
                "{key}: {} is no whole number from 0 to {}",
                quoted(word),
                u32::MAX
            ))),
        }
    }

    pub(super) fn malformed(&self, reason: impl Into<String>) -> Malformed {
        self.line.malformed(reason)
    }

    pub(super) fn unknown(&self, key: &str, known: &str) -> Malformed {
        self.line.malformed(format!(
            "unknown key {}; a {} has {known}",
            quoted(key),
            self.line.kind
        ))
    }
}
