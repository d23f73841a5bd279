//! What an option takes: which values are allowed, and how that is said.

use std::ffi::OsStr;

use replay::shown::shown;

use super::{Opt, Takes, UsageError, nearest};

impl Takes {
    /// Returns the word that stands for a value in the help text; empty: none does.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Takes::Nothing => "",
            Takes::Number { .. } => "N",
            Takes::Numbers { .. } => "N,N,...",
            Takes::OneOf(_) => "WORD",
            Takes::Text(what) | Takes::File(what) => what,
        }
    }

    /// Says in words which values are allowed.
    fn allowed(self) -> String {
        match self {
            Takes::Nothing => "nothing".into(),
            Takes::Number { least, most } => format!("a number from {least} to {most}"),
            Takes::Numbers { least, most } => {
                format!("numbers from {least} to {most} with commas between")
            }
            Takes::OneOf(words) => format!("one of {}", words.join(", ")),
            Takes::Text(what) | Takes::File(what) => format!("a {}", what.to_lowercase()),
        }
    }
}

impl Opt {
    /// Checks a value against what the option takes.
    pub(super) fn check(&self, value: &OsStr) -> Result<(), UsageError> {
        let text = value.to_str();
        let valid = match (self.takes, text) {
            (Takes::Nothing, _) => true,
            (Takes::File(_), _) => !value.is_empty(),
            (_, None) => false,
            (Takes::Number { least, most }, Some(text)) => is_number(text, least, most),
            (Takes::Numbers { least, most }, Some(text)) => {
                text.split(',').all(|number| is_number(number, least, most))
            }
            (Takes::OneOf(words), Some(text)) => words.contains(&text),
            (Takes::Text(_), Some(text)) => !text.is_empty(),
        };
        if valid {
            return Ok(());
        }
        let allowed = self.takes.allowed();
        let must = match (self.takes, text) {
            (Takes::OneOf(words), Some(text)) => match nearest(text, words) {
                Some(near) => format!("must be {allowed}; did you mean `{near}`?"),
                None => format!("must be {allowed}"),
            },
            (_, Some(_)) => format!("must be {allowed}"),
            (_, None) => format!("is not UTF-8 text; must be {allowed}"),
        };
        let value = value.to_string_lossy();
        let (name, value) = (self.name, shown(&value));
        Err(UsageError(format!("`--{name} {value}`: {must}")))
    }

    /// Says that no value stands after the option. Where an option follows, one that
    /// was meant as the value could be attached.
    pub(super) fn missing(&self, is_followed: bool) -> UsageError {
        let (name, allowed) = (self.name, self.takes.allowed());
        let remedy = match (self.takes, is_followed) {
            (Takes::Text(_) | Takes::File(_), true) => {
                format!("; one that begins with `-` is written `--{name}=VALUE`")
            }
            _ => String::new(),
        };
        UsageError(format!(
            "option `--{name}` lacks its value: {allowed}{remedy}"
        ))
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
