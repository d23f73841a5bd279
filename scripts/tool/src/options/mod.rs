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
//!
//! Words come as the system hands them over, and need not be text. The name of a file
//! may be anything; every other word must be UTF-8.

mod help;
mod menu;
mod parsed;
mod read;
mod value;

use std::ffi::{OsStr, OsString};
use std::fmt;
use std::ops::RangeInclusive;
use std::os::unix::ffi::OsStrExt;

use replay::shown::quoted;

pub use menu::{Choice, Menu, choices};
pub use parsed::Parsed;
pub(crate) use read::BY_PERSON;
pub use read::Refusal;
pub use sched_dag::nearest;

/// A subcommand of the tool.
#[derive(Debug)]
pub struct Command {
    /// What the person types, such as `./scripts/run`.
    pub invocation: &'static str,
    /// One sentence on what it does.
    pub about: &'static str,
    /// The positional words it takes, if any, and their help. One word, or any
    /// number if the name that stands for it ends in `...`.
    pub positional: Option<(Takes, &'static str)>,
    /// The options, in the order of the help text.
    pub options: &'static [Opt],
    /// What else the help text says, after the options.
    pub notes: &'static str,
}

/// One option of a command.
#[derive(Clone, Copy, Debug)]
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

/// Makes the options of a [`Command`]: above each its sentence for the help text; a short form stands
/// behind the name, and the value when the option is not given behind `or`.
macro_rules! options {
    ($($(#[doc = $help:literal])+ $name:literal $($short:literal)?: $takes:expr $(, or $default:expr)?;)*) => {
        &[$(
            $crate::options::Opt::new($name, $takes, concat!($($help),+))$(.short($short))?$(.or($default))?
        ),*]
    };
}
pub(crate) use options;

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
    /// The name of a file or folder, of any bytes; the word stands for it likewise.
    File(&'static str),
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
    pub fn parse(&self, words: &[OsString]) -> Result<Request, UsageError> {
        let mut parsed = Parsed::new(self.options);
        let mut words = words.iter().map(OsString::as_os_str).peekable();
        while let Some(word) = words.next() {
            if word == "--help" || word == "-h" {
                return Ok(Request::Help(self.help()));
            }
            if !word.as_bytes().starts_with(b"-") || word == "-" {
                self.take_positional(&mut parsed, word)?;
                continue;
            }
            let (name, attached) = split(word);
            let option = self.find(name, attached)?;
            if parsed.is_given(option.name) {
                return Err(UsageError(format!(
                    "option `--{}` stands twice; give it once",
                    option.name
                )));
            }
            let value = match (option.takes, attached) {
                (Takes::Nothing, None) => OsStr::new("yes"),
                (Takes::Nothing, Some(_)) => return Err(takes_no_value(option.name)),
                (_, Some(value)) => value,
                // What looks like an option is meant as one.
                (_, None) => words
                    .next_if(|next| !self.is_option(next))
                    .ok_or_else(|| option.missing(words.peek().is_some()))?,
            };
            option.check(value)?;
            parsed.take(option.name, value);
        }
        Ok(Request::Work(parsed))
    }

    fn take_positional(&self, parsed: &mut Parsed, word: &OsStr) -> Result<(), UsageError> {
        let shown = quoted(&word.to_string_lossy()).to_string();
        let Some((takes, _)) = self.positional else {
            return Err(UsageError(format!(
                "unknown word {shown}; options begin with `--`, see {} --help",
                self.invocation
            )));
        };
        let name = takes.name();
        if let Some(first) = parsed.files().next()
            && !name.ends_with("...")
        {
            return Err(UsageError(format!(
                "{shown}: only one {name} is allowed, and {} is one",
                quoted(&first.to_string_lossy())
            )));
        }
        if matches!(takes, Takes::Text(_)) && word.to_str().is_none() {
            return Err(UsageError(format!(
                "{shown}: a {name} must be UTF-8 text; write it so"
            )));
        }
        parsed.take_positional(word);
        Ok(())
    }

    /// Reports whether a word begins as an option does, or is the short form of one.
    fn is_option(&self, word: &OsStr) -> bool {
        let is_short = |name: &str| self.named(name).is_some();
        word.as_bytes().starts_with(b"--") || word.to_str().is_some_and(is_short)
    }

    fn named(&self, name: &str) -> Option<&'static Opt> {
        self.options
            .iter()
            .find(|option| match name.strip_prefix("--") {
                Some(long) => option.name == long,
                None => (option.short)
                    .is_some_and(|short| name.strip_prefix('-') == Some(&*short.to_string())),
            })
    }

    /// Finds the option of this name, to which this value is attached.
    fn find(&self, name: &OsStr, attached: Option<&OsStr>) -> Result<&'static Opt, UsageError> {
        let name = name.to_string_lossy();
        if attached.is_some() && (name == "--help" || name == "-h") {
            return Err(takes_no_value("help"));
        }
        self.named(&name).ok_or_else(|| self.unknown(&name))
    }

    fn unknown(&self, name: &str) -> UsageError {
        let names = self.options.iter().map(|option| option.name);
        let allowed = names.chain(["help"]).collect::<Vec<_>>();
        let hint = match nearest(name.trim_start_matches('-'), &allowed) {
            Some(near) => format!("did you mean `--{near}`?"),
            None => format!("allowed are --{}", allowed.join(", --")),
        };
        UsageError(format!("unknown option {}; {hint}", quoted(name)))
    }
}

fn takes_no_value(name: &str) -> UsageError {
    UsageError(format!("option `--{name}` takes no value; write it alone"))
}

/// Splits a word into the name of an option and the value attached by `=`.
fn split(word: &OsStr) -> (&OsStr, Option<&OsStr>) {
    let bytes = word.as_bytes();
    match bytes.iter().position(|byte| *byte == b'=') {
        Some(at) => (
            OsStr::from_bytes(&bytes[..at]),
            Some(OsStr::from_bytes(&bytes[at + 1..])),
        ),
        None => (word, None),
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
}

#[cfg(test)]
mod tests;
