//! One option: what it takes, which values are allowed, and how that is said.

use std::ffi::OsStr;
use std::ops::RangeInclusive;

use replay::shown::shown;

use super::nearest;

/// One option of a command.
#[derive(Clone, Copy, Debug)]
pub struct Opt {
    /// The long name without its dashes.
    pub name: &'static str,
    /// The short form without its dash, such as `q`.
    pub short: Option<char>,
    /// The form of what must follow.
    pub takes: Takes,
    /// The value when the option is not given; empty: it has none.
    pub default: &'static str,
    /// One sentence for the help text.
    pub help: &'static str,
}

/// Makes the options of a [`Command`](super::Command): above each its sentence for the help text; a
/// short form stands behind the name, and the value when the option is not given behind `or`.
macro_rules! options {
    ($($(#[doc = $help:literal])+ $name:literal $($short:literal)?: $takes:expr $(, or $default:expr)?;)*) => {
        &[$(
            $crate::options::Opt::new($name, $takes, concat!($($help),+))$(.short($short))?$(.or($default))?
        ),*]
    };
}
pub(crate) use options;

/// A value that follows an option.
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
        /// Whether there may be more, with commas between.
        is_list: bool,
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
        let (least, most, is_list) = (*range.start(), *range.end(), false);
        Takes::Number {
            least,
            most,
            is_list,
        }
    }

    /// Takes numbers of a range with commas between.
    #[must_use]
    pub const fn numbers(range: RangeInclusive<u64>) -> Takes {
        let (least, most, is_list) = (*range.start(), *range.end(), true);
        Takes::Number {
            least,
            most,
            is_list,
        }
    }

    /// Returns the word that stands for a value in the help text; empty: none does.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Takes::Nothing => "",
            Takes::Number { is_list: false, .. } => "N",
            Takes::Number { is_list: true, .. } => "N,N,...",
            Takes::OneOf(_) => "WORD",
            Takes::Text(what) | Takes::File(what) => what,
        }
    }

    /// Says in words which values are allowed.
    fn allowed(self) -> String {
        match self {
            Takes::Nothing => "nothing".into(),
            Takes::Number {
                least,
                most,
                is_list: false,
            } => format!("a number from {least} to {most}"),
            Takes::Number { least, most, .. } => {
                format!("numbers from {least} to {most} with commas between")
            }
            Takes::OneOf(words) => format!("one of {}", words.join(", ")),
            Takes::Text(what) | Takes::File(what) => format!("a {}", what.to_lowercase()),
        }
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
    pub(super) fn check(&self, value: &OsStr) -> Result<(), String> {
        let text = value.to_str();
        let valid = match (self.takes, text) {
            (Takes::Nothing, _) => true,
            (Takes::File(_), _) => !value.is_empty(),
            (_, None) => false,
            (
                Takes::Number {
                    least,
                    most,
                    is_list,
                },
                Some(text),
            ) => {
                let mut numbers = text.split(',');
                let is_number = |text| number(text).is_some_and(|n| (least..=most).contains(&n));
                numbers.all(is_number) && (is_list || !text.contains(','))
            }
            (Takes::OneOf(words), Some(text)) => words.contains(&text),
            (Takes::Text(_), Some(text)) => !text.is_empty(),
        };
        if valid {
            return Ok(());
        }
        let mut must = format!("must be {}", self.takes.allowed());
        match (self.takes, text) {
            (_, None) => must = format!("is not UTF-8 text; {must}"),
            (Takes::OneOf(words), Some(text)) => {
                let near = nearest(text, words);
                must += &near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
            }
            _ => {}
        }
        let value = value.to_string_lossy();
        Err(format!("`--{} {}`: {must}", self.name, shown(&value)))
    }

    /// Says that no value stands after the option. Where an option follows, one that
    /// was meant as the value could be attached.
    pub(super) fn missing(&self, is_followed: bool) -> String {
        let (name, allowed) = (self.name, self.takes.allowed());
        let remedy = match (self.takes, is_followed) {
            (Takes::Text(_) | Takes::File(_), true) => {
                format!("; one that begins with `-` is written `--{name}=VALUE`")
            }
            _ => String::new(),
        };
        format!("option `--{name}` lacks its value: {allowed}{remedy}")
    }

    /// Returns how the help text writes the option.
    pub(super) fn heading(&self) -> String {
        let short = self.short.map(|short| format!("-{short}, "));
        let heading = format!(
            "{:4}--{} {}",
            short.unwrap_or_default(),
            self.name,
            self.takes.name()
        );
        heading.trim_end().into()
    }

    /// Returns the help text's sentence, with what is allowed and the default.
    pub(super) fn sentence(&self) -> String {
        let mut parts = Vec::new();
        match self.takes {
            // A bound that no one can reach would only be noise.
            Takes::Number { least, most, .. } => parts.push(match most {
                u64::MAX => format!("from {least}"),
                most => format!("{least} to {most}"),
            }),
            Takes::OneOf(words) => parts.push(words.join(" | ")),
            Takes::Nothing | Takes::Text(_) | Takes::File(_) => {}
        }
        if !self.default.is_empty() {
            parts.push(format!("default {}", self.default));
        }
        if parts.is_empty() {
            return self.help.into();
        }
        format!("{} [{}]", self.help, parts.join("; "))
    }
}

fn number(text: &str) -> Option<u64> {
    // `parse` alone would let `+1` pass.
    let is_plain = text.bytes().all(|byte| byte.is_ascii_digit());
    text.parse().ok().filter(|_| is_plain)
}
