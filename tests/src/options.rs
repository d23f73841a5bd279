//! Command lines, described by a table and read by one function.
//!
//! A [`Command`] lists its [`Opt`]ions; the table is the whole truth: what is
//! accepted, the range of each value, the default, and the text of `--help`
//! all come from it. An option is written `--name value` or `--name=value`,
//! a *flag* takes no value, and a *positional* is any word that is no option.
//!
//! Whatever is not in the table is refused with one line that names it, says
//! what is allowed and, where a name is near, suggests it. Nothing is guessed
//! and nothing is done before the whole line is understood.

mod help;
mod menu;
mod read;
mod suggest;

use std::collections::BTreeMap;
use std::fmt;
use std::ops::RangeInclusive;

pub use menu::{Choice, Menu};
pub use suggest::nearest;

/// A subcommand of the tool.
#[derive(Debug)]
pub struct Command {
    /// What the person types, such as `./scripts/run`.
    pub invocation: &'static str,
    /// One sentence on what it does.
    pub about: &'static str,
    /// The positional words it takes, if any: their name and their help. One
    /// word, or any number if the name ends in `...`.
    pub positional: Option<(&'static str, &'static str)>,
    /// The options, in the order of the help text.
    pub options: &'static [Opt],
    /// What else the help text says, after the options.
    pub notes: &'static str,
}

/// One option of a command.
#[derive(Debug)]
pub struct Opt {
    /// The long name without its dashes.
    pub name: &'static str,
    /// The short form without its dash, such as `q`.
    pub short: Option<char>,
    /// What must follow.
    pub takes: Takes,
    /// The value when the option is not given; empty: it has none.
    pub default: &'static str,
    /// One sentence for the help text.
    pub help: &'static str,
}

/// What follows an option.
#[derive(Clone, Copy, Debug)]
pub enum Takes {
    /// Nothing: the option is a flag.
    Nothing,
    /// A decimal number within bounds, both included.
    Number {
        /// The smallest number allowed.
        least: u64,
        /// The largest number allowed.
        most: u64,
    },
    /// One or more such numbers with commas between.
    Numbers {
        /// The smallest number allowed.
        least: u64,
        /// The largest number allowed.
        most: u64,
    },
    /// One of these words.
    OneOf(&'static [&'static str]),
    /// Any text; the word stands for it in the help text.
    Text(&'static str),
}

impl Takes {
    /// Takes a number of a range.
    #[must_use]
    pub const fn number(range: RangeInclusive<u64>) -> Takes {
        let (least, most) = (*range.start(), *range.end());
        Takes::Number { least, most }
    }

    /// Takes numbers of a range with commas between.
    #[must_use]
    pub const fn numbers(range: RangeInclusive<u64>) -> Takes {
        let (least, most) = (*range.start(), *range.end());
        Takes::Numbers { least, most }
    }
}

/// A command line that was understood.
#[derive(Clone, Debug)]
pub struct Parsed {
    values: BTreeMap<&'static str, String>,
    given: Vec<&'static str>,
    positionals: Vec<String>,
}

/// What a command line asks for.
#[derive(Debug)]
pub enum Request {
    /// To do the command's work.
    Work(Parsed),
    /// To be shown this help text.
    Help(String),
}

/// A command line that breaks the command's table: one line of text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UsageError(pub String);

impl fmt::Display for UsageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for UsageError {}

impl Command {
    /// Reads a command line (without the program's and the command's name).
    ///
    /// # Errors
    ///
    /// The first word that the table does not allow.
    pub fn parse(&self, words: &[String]) -> Result<Request, UsageError> {
        let mut parsed = self.defaults();
        let mut words = words.iter();
        while let Some(word) = words.next() {
            if word == "--help" || word == "-h" {
                return Ok(Request::Help(self.help()));
            }
            if !word.starts_with('-') || word == "-" {
                self.take_positional(&mut parsed, word)?;
                continue;
            }
            let (option, attached) = self.find(word)?;
            if parsed.given.contains(&option.name) {
                return Err(UsageError(format!(
                    "option `--{}` stands twice; give it once",
                    option.name
                )));
            }
            let value = match (option.takes, attached) {
                (Takes::Nothing, None) => "yes".into(),
                (Takes::Nothing, Some(_)) => {
                    return Err(UsageError(format!(
                        "option `--{}` takes no value; write it alone",
                        option.name
                    )));
                }
                (_, Some(value)) => value.to_string(),
                (_, None) => words.next().cloned().ok_or_else(|| option.missing())?,
            };
            option.check(&value)?;
            parsed.values.insert(option.name, value);
            parsed.given.push(option.name);
        }
        Ok(Request::Work(parsed))
    }

    fn defaults(&self) -> Parsed {
        let with_default = self
            .options
            .iter()
            .filter(|option| !option.default.is_empty());
        Parsed {
            values: with_default
                .map(|option| (option.name, option.default.to_string()))
                .collect(),
            given: Vec::new(),
            positionals: Vec::new(),
        }
    }

    fn take_positional(&self, parsed: &mut Parsed, word: &str) -> Result<(), UsageError> {
        match (self.positional, parsed.positionals.first()) {
            (Some((name, _)), Some(first)) if !name.ends_with("...") => Err(UsageError(format!(
                "`{word}`: only one {name} is allowed, and `{first}` is one"
            ))),
            (Some(_), _) => {
                parsed.positionals.push(word.to_string());
                Ok(())
            }
            (None, _) => Err(UsageError(format!(
                "unknown word `{word}`; options begin with `--`, see {} --help",
                self.invocation
            ))),
        }
    }

    /// Finds the option that a word names, and the value attached by `=`.
    fn find<'w>(&self, word: &'w str) -> Result<(&'static Opt, Option<&'w str>), UsageError> {
        let (name, attached) = match word.split_once('=') {
            Some((name, value)) => (name, Some(value)),
            None => (word, None),
        };
        let is_it = |option: &&Opt| match name.strip_prefix("--") {
            Some(long) => option.name == long,
            None => option
                .short
                .is_some_and(|short| name[1..] == *short.to_string()),
        };
        match self.options.iter().find(is_it) {
            Some(option) => Ok((option, attached)),
            None => Err(self.unknown(name)),
        }
    }

    fn unknown(&self, name: &str) -> UsageError {
        let names = self.options.iter().map(|option| option.name);
        let allowed = names.chain(["help"]).collect::<Vec<_>>();
        let hint = match nearest(name.trim_start_matches('-'), &allowed) {
            Some(near) => format!("did you mean `--{near}`?"),
            None => format!("allowed are --{}", allowed.join(", --")),
        };
        UsageError(format!("unknown option `{name}`; {hint}"))
    }
}

impl Opt {
    /// Describes an option without short form and default.
    #[must_use]
    pub const fn new(name: &'static str, takes: Takes, help: &'static str) -> Opt {
        Opt {
            name,
            short: None,
            takes,
            default: "",
            help,
        }
    }

    /// Adds a short form, without its dash.
    #[must_use]
    pub const fn short(mut self, short: char) -> Opt {
        self.short = Some(short);
        self
    }

    /// Adds the value when the option is not given.
    #[must_use]
    pub const fn or(mut self, default: &'static str) -> Opt {
        self.default = default;
        self
    }

    /// Checks a value against what the option takes.
    fn check(&self, value: &str) -> Result<(), UsageError> {
        let valid = match self.takes {
            Takes::Nothing => true,
            Takes::Number { least, most } => is_number(value, least, most),
            Takes::Numbers { least, most } => value
                .split(',')
                .all(|number| is_number(number, least, most)),
            Takes::OneOf(words) => words.contains(&value),
            Takes::Text(_) => !value.is_empty(),
        };
        if valid {
            return Ok(());
        }
        let hint = match self.takes {
            Takes::OneOf(words) => nearest(value, words),
            _ => None,
        };
        let hint = hint.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
        Err(UsageError(format!(
            "`--{} {value}`: must be {}{hint}",
            self.name,
            self.allowed()
        )))
    }

    fn missing(&self) -> UsageError {
        UsageError(format!(
            "option `--{}` lacks its value: {}",
            self.name,
            self.allowed()
        ))
    }

    /// Says in words which values are allowed.
    fn allowed(&self) -> String {
        match self.takes {
            Takes::Nothing => "nothing".into(),
            Takes::Number { least, most } => format!("a number from {least} to {most}"),
            Takes::Numbers { least, most } => {
                format!("numbers from {least} to {most} with commas between")
            }
            Takes::OneOf(words) => format!("one of {}", words.join(", ")),
            Takes::Text(what) => format!("a {}", what.to_lowercase()),
        }
    }
}

fn is_number(text: &str, least: u64, most: u64) -> bool {
    // `parse` alone would let `+1` pass.
    let number = text
        .bytes()
        .all(|byte| byte.is_ascii_digit())
        .then(|| text.parse::<u64>());
    matches!(number, Some(Ok(number)) if (least..=most).contains(&number))
}

impl Parsed {
    /// Returns whether the person gave the option (or flag).
    #[must_use]
    pub fn is_given(&self, name: &str) -> bool {
        self.given.contains(&name)
    }

    /// Returns the option's value or default; `None` if it has neither.
    #[must_use]
    pub fn text(&self, name: &str) -> Option<&str> {
        self.values.get(name).map(String::as_str)
    }

    /// Returns a number's value or default; `None` if it has neither.
    #[must_use]
    pub fn number(&self, name: &str) -> Option<u64> {
        self.text(name).and_then(|value| value.parse().ok())
    }

    /// Returns the same command line with another value of an option, as if the
    /// person had given it.
    #[must_use]
    pub fn with(&self, name: &'static str, value: &str) -> Parsed {
        let mut other = self.clone();
        other.values.insert(name, value.into());
        other.given.push(name);
        other
    }

    /// Returns the first positional word, if one was given.
    #[must_use]
    pub fn positional(&self) -> Option<&str> {
        self.positionals.first().map(String::as_str)
    }

    /// Returns all positional words.
    #[must_use]
    pub fn positionals(&self) -> &[String] {
        &self.positionals
    }
}

#[cfg(test)]
mod tests;
