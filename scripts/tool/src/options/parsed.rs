//! A command line that was understood: the value of each option.

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::path::Path;
use std::str::FromStr;

use replay::shown::quoted;

use super::Opt;
use crate::files::Named;

/// A command line that was understood.
#[derive(Clone, Debug)]
pub struct Parsed {
    options: &'static [Opt],
    given: BTreeMap<&'static str, OsString>,
    positionals: Vec<OsString>,
}

impl Parsed {
    /// Begins with the defaults of these options.
    pub(super) fn new(options: &'static [Opt]) -> Parsed {
        Parsed {
            options,
            given: BTreeMap::new(),
            positionals: Vec::new(),
        }
    }

    pub(super) fn take(&mut self, name: &'static str, value: &OsStr) {
        self.given.insert(name, value.into());
    }

    pub(super) fn take_positional(&mut self, word: &OsStr) {
        self.positionals.push(word.into());
    }

    /// Returns whether the person gave the option (or flag).
    #[must_use]
    pub fn is_given(&self, name: &str) -> bool {
        self.given.contains_key(name)
    }

    fn value(&self, name: &str) -> Option<&OsStr> {
        let default = || {
            let mut options = self.options.iter();
            let option = options.find(|option| option.name == name)?;
            (!option.default.is_empty()).then(|| OsStr::new(option.default))
        };
        self.given
            .get(name)
            .map(OsString::as_os_str)
            .or_else(default)
    }

    /// Returns the option's value or default; `None` if it has neither. For one that
    /// takes a file there is [`path`](Self::path).
    #[must_use]
    pub fn text(&self, name: &str) -> Option<&str> {
        self.value(name).and_then(OsStr::to_str)
    }

    /// Returns the file that the option names, or its default; `None` if it has neither.
    #[must_use]
    pub fn path(&self, name: &str) -> Option<&Path> {
        self.value(name).map(Path::new)
    }

    /// Returns the files that options of these names name, as far as they are given.
    #[must_use]
    pub fn named(&self, options: &[&'static str]) -> Vec<Named<'_>> {
        let named = options.iter().filter_map(|option| {
            let path = self.path(option)?;
            Some(Named { option, path })
        });
        named.collect()
    }

    /// Returns a number's value or default; `None` if it has neither.
    #[must_use]
    pub fn number(&self, name: &str) -> Option<u64> {
        self.text(name).and_then(|value| value.parse().ok())
    }

    /// Returns the numbers of a list.
    #[must_use]
    pub fn numbers<N: FromStr>(&self, name: &str) -> Vec<N> {
        let words = self.text(name).into_iter().flat_map(|all| all.split(','));
        words.filter_map(|word| word.parse().ok()).collect()
    }

    /// Makes sure that nothing stands twice among the values with commas between of
    /// these options.
    ///
    /// # Errors
    ///
    /// In words, with the option and the value.
    pub fn check_distinct(&self, options: &[&'static str]) -> Result<(), String> {
        for option in options {
            let mut before = Vec::new();
            for value in self.text(option).iter().flat_map(|all| all.split(',')) {
                if before.contains(&value) {
                    let value = quoted(value);
                    return Err(format!("`--{option}`: {value} stands twice; give it once"));
                }
                before.push(value);
            }
        }
        Ok(())
    }

    /// Makes sure that of each pair of options at most one is given.
    ///
    /// # Errors
    ///
    /// In words, with both and what they do, such as to exclude each other.
    pub fn check_apart(&self, pairs: &[(&str, &str, &str)]) -> Result<(), String> {
        let both =
            |(one, other, _): &&(&str, &str, &str)| self.is_given(one) && self.is_given(other);
        match pairs.iter().find(both) {
            Some((one, other, do_what)) => {
                Err(format!("`--{one}` and `--{other}` {do_what}; give one"))
            }
            None => Ok(()),
        }
    }

    /// Returns the first of these options that is given.
    #[must_use]
    pub fn given_of<'n>(&self, names: &[&'n str]) -> Option<&'n str> {
        names.iter().copied().find(|name| self.is_given(name))
    }

    /// Returns the same command line with another value of an option, as if the
    /// person had given it.
    #[must_use]
    pub fn with(&self, name: &'static str, value: impl AsRef<OsStr>) -> Parsed {
        let mut other = self.clone();
        other.take(name, value.as_ref());
        other
    }

    /// Returns the same as if a flag had not been given.
    #[must_use]
    pub fn without(&self, name: &str) -> Parsed {
        let mut other = self.clone();
        other.given.remove(name);
        other
    }

    /// Returns the first positional word, if one was given.
    #[must_use]
    pub fn positional(&self) -> Option<&str> {
        self.positionals.first().and_then(|word| word.to_str())
    }

    /// Returns the first positional argument as a file, or else the question which it is.
    ///
    /// # Errors
    ///
    /// The question: there is none.
    pub fn file(&self, question: &str) -> Result<Named<'_>, String> {
        let path = self.files().next().ok_or(question)?;
        Ok(Named { option: "", path })
    }

    /// Returns the files that the positional words name.
    pub fn files(&self) -> impl ExactSizeIterator<Item = &Path> + Clone {
        self.positionals.iter().map(Path::new)
    }
}
