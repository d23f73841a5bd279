//! A machine line whose members are asked for, each refused with the line if it is not as
//! the format says.

use std::ops::RangeInclusive;

use crate::json::Value;
use crate::protocol::MachineLine;
use replay::lines::Malformed;
use replay::shown::quoted;

/// A machine line whose members are asked for.
#[derive(Clone, Copy, Debug)]
pub struct Line<'a>(pub &'a MachineLine);

impl Line<'_> {
    pub(crate) fn malformed(&self, reason: impl Into<String>) -> Malformed {
        Malformed {
            line: self.0.number,
            reason: format!("`{}`: {}", self.0.kind, reason.into()),
        }
    }

    pub(crate) fn unknown(&self, name: &str, found: &str, allowed: &str) -> Malformed {
        let found = quoted(found);
        self.malformed(format!("`{name}` is {found} and must be {allowed}"))
    }

    /// Returns a member that is true or false, and false if it is left out.
    pub(crate) fn flag(&self, name: &str) -> Result<bool, Malformed> {
        match self.0.value.get(name) {
            None => Ok(false),
            Some(Value::Bool(flag)) => Ok(*flag),
            Some(_) => Err(self.malformed(format!("`{name}` is neither true nor false"))),
        }
    }

    pub(crate) fn within(&self, name: &str, range: RangeInclusive<u64>) -> Result<u64, Malformed> {
        let number = self.number(name)?;
        match range.contains(&number) {
            true => Ok(number),
            false if *range.end() == u64::MAX => {
                let least = range.start();
                Err(self.malformed(format!("`{name}` is {number} and must be at least {least}")))
            }
            false => {
                let (least, most) = range.into_inner();
                let reason = format!("`{name}` is {number} and must be from {least} to {most}");
                Err(self.malformed(reason))
            }
        }
    }

    pub(crate) fn number(&self, name: &str) -> Result<u64, Malformed> {
        let reason = || self.malformed(format!("`{name}` is not a number from 0"));
        self.0.number_at(name).ok_or_else(reason)
    }

    pub(crate) fn text(&self, name: &str) -> Result<&str, Malformed> {
        let reason = || self.malformed(format!("`{name}` is not text"));
        self.0.text_at(name).ok_or_else(reason)
    }

    pub(crate) fn elements(&self, name: &str) -> Result<&[Value], Malformed> {
        match self.0.value.get(name) {
            Some(Value::Array(elements)) => Ok(elements),
            _ => Err(self.malformed(format!("`{name}` is not a list"))),
        }
    }

    pub(crate) fn small(&self, number: u64) -> Result<u32, Malformed> {
        u32::try_from(number).map_err(|error| self.malformed(error.to_string()))
    }
}
