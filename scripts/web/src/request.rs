//! Requests, read, and refusals of requests.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;

use text::{Malformed, quoted};
use views::json::Object;

use crate::tables::framed;

/// The words of all requests. A request may have some words without using them.
const NAMES: &str = "app clusters cores dag dags execution from job judge live names of overheads \
                     periods policy preemption run seed set sizes to";

/// A request.
pub(crate) struct Request<'r> {
    /// The first word.
    pub(crate) what: &'r str,
    words: Vec<(&'r str, String)>,
    /// The bytes behind the line.
    pub(crate) body: &'r [u8],
}

impl<'r> Request<'r> {
    /// Reads a request.
    pub(crate) fn read(bytes: &'r [u8]) -> Result<Self, String> {
        let end = bytes.iter().position(|byte| *byte == b'\n');
        let line = end.and_then(|end| std::str::from_utf8(&bytes[..end]).ok());
        let line = line.ok_or("the request has no line of words; begin with one")?;
        let (what, words) = line.split_once(' ').unwrap_or((line, ""));
        let word = |word: &'r str| {
            let known = word.split_once('=');
            let known = known.filter(|(name, _)| NAMES.split(' ').any(|known| known == *name));
            let value = known.map(|(name, value)| (name, decoded(value)));
            value.ok_or_else(|| format!("{} is no word; known are {NAMES}", quoted(word)))
        };
        let words = words.split_whitespace().map(word);
        Ok(Self {
            what,
            words: words.collect::<Result<_, String>>()?,
            body: &bytes[line.len() + 1..],
        })
    }

    /// Returns the value of a word; an empty value counts as no value.
    pub(crate) fn text(&self, name: &str) -> Option<&str> {
        let mut words = self.words.iter().rev();
        let (_, value) = words.find(|word| word.0 == name)?;
        (!value.is_empty()).then_some(value)
    }

    /// Returns the number of a word, or `otherwise` without the word.
    pub(crate) fn number<N: FromStr + PartialOrd + Display>(
        &self,
        name: &str,
        within: RangeInclusive<N>,
        otherwise: N,
    ) -> Result<N, String> {
        let Some(text) = self.text(name) else {
            return Ok(otherwise);
        };
        let number = text.parse().ok().filter(|number| within.contains(number));
        let (least, most, text) = (within.start(), within.end(), quoted(text));
        number.ok_or_else(|| format!("{name}: {text} is no number from {least} to {most}"))
    }

    /// Returns the choice of a word; without the word, the first choice.
    pub(crate) fn choice<T: Copy>(&self, name: &str, from: &[(&str, T)]) -> Result<T, String> {
        let text = self.text(name).unwrap_or(from[0].0);
        let chosen = from.iter().find(|(word, _)| *word == text);
        chosen.map(|(_, choice)| *choice).ok_or_else(|| {
            let words: Vec<&str> = from.iter().map(|(word, _)| *word).collect();
            let (text, words) = (quoted(text), words.join(" or "));
            format!("{name}: {text} is not known; give {words}")
        })
    }
}

/// Returns a value with its blanks and percent signs, written in a word as `%20` and `%25`.
fn decoded(value: &str) -> String {
    value.replace("%20", " ").replace("%25", "%")
}

/// The reasons of a refusal: lines of the file with their faults; 0 is no line.
pub(crate) struct Faults(pub(crate) Vec<Malformed>);

impl From<String> for Faults {
    fn from(reason: String) -> Self {
        Self(vec![Malformed { line: 0, reason }])
    }
}

impl Faults {
    /// Returns the answer that tells the reasons.
    pub(crate) fn answer(&self) -> Vec<u8> {
        let faults = self.0.iter().map(|Malformed { line, reason }| {
            let fault = Object::new().number("line", *line as u64);
            fault.text("why", reason).into_text()
        });
        framed(&Object::new().list("faults", faults).into_text(), &[])
    }
}
