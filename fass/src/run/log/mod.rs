//! The log: lines that functions say while they run, for people.
//!
//! [`log!`](crate::log!) puts a *line* into a ring of fixed size, and goes on. Nothing is allocated,
//! nobody is waited for, and no text is made: what reads the ring for people does that, by [`take`],
//! when the cores have nothing else to do. If the ring is full, the new line is left out and counted.
//!
//! # What is guaranteed
//!
//! - A line of a level that is off costs a load and a branch; its fields are not computed. (In
//!   virtual time they are.)
//! - A line is no result. It is shown although its instance fails later, for it may say why.
//!
//! # What is not
//!
//! - Lines of several cores come in about the order in which they were said; their times tell.
//! - An instance that is ended by its budget amidst a line takes the line's place with it: one of
//!   64, until the next boot.

mod ring;

use core::array;
use core::fmt::{self, Display, Formatter};
use core::sync::atomic::{AtomicU8, Ordering};

use sched_dag::{Instance, TaskSet};

pub(crate) use ring::keep;
pub use ring::take;

/// The most fields of a line.
pub const FIELDS: usize = 4;

/// The most bytes of a field's text; what is longer is cut.
pub const TEXT_BYTES: usize = 24;

/// How much a line matters.
///
/// ```standalone_crate
/// use fass::log::{Level, set_level};
///
/// assert!(Level::Info.is_on() && !Level::Debug.is_on()); // by default
/// set_level(Some(Level::Warn));
/// assert!(Level::Error.is_on() && !Level::Info.is_on());
/// set_level(None);
/// assert!(!Level::Error.is_on());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Level {
    /// Something does not work.
    Error = 1,
    /// Something may not.
    Warn,
    /// What goes on.
    Info,
    /// What helps to find a mistake.
    Debug,
}

/// The level that is on; 0: none.
static LEVEL: AtomicU8 = AtomicU8::new(Level::Info as u8);

/// Has lines kept up to this level, or none.
///
/// See [`Level`].
pub fn set_level(most: Option<Level>) {
    LEVEL.store(most.map_or(0, |level| level as u8), Ordering::Relaxed);
}

impl Level {
    /// Reports whether lines of this level are kept.
    ///
    /// See [`Level`].
    #[inline(always)]
    #[must_use]
    pub fn is_on(self) -> bool {
        self as u8 <= LEVEL.load(Ordering::Relaxed)
    }

    /// Returns its word.
    ///
    /// ```
    /// assert_eq!(fass::log::Level::Warn.word(), "warn");
    /// ```
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Warn => "warn",
            Self::Info => "info",
            Self::Debug => "debug",
        }
    }
}

/// A place in a program that says a line: what is known of it beforehand.
#[doc(hidden)]
#[derive(Debug)]
pub struct Site {
    level: Level,
    text: &'static str,
    keys: &'static [&'static str],
}

impl Site {
    /// Takes the level, the text and the fields' keys.
    ///
    /// # Panics
    ///
    /// If there are more than [`FIELDS`].
    #[must_use]
    pub const fn new(level: Level, text: &'static str, keys: &'static [&'static str]) -> Self {
        assert!(keys.len() <= FIELDS, "a line has four fields at most");
        Self { level, text, keys }
    }

    /// Reports whether its lines are kept.
    #[inline(always)]
    #[must_use]
    pub fn is_on(&self) -> bool {
        self.level.is_on()
    }
}

/// The value of a field: made of a number, a truth value or a text.
///
/// See [`log!`](crate::log!).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A whole number.
    Unsigned(u64),
    /// One that may be negative.
    Signed(i64),
    /// Any number.
    Float(f64),
    /// A truth value.
    Flag(bool),
    /// The bytes of a text, and how many they are.
    Text([u8; TEXT_BYTES], u8),
}

macro_rules! value_from {
    ($($type:ty: $kind:ident),*) => {$(
        impl From<$type> for Value {
            fn from(value: $type) -> Self {
                Self::$kind(value.into())
            }
        }
    )*};
}

value_from!(
    u8: Unsigned, u16: Unsigned, u32: Unsigned, u64: Unsigned, i8: Signed, i16: Signed,
    i32: Signed, i64: Signed, f32: Float, f64: Float, bool: Flag
);

impl From<usize> for Value {
    fn from(value: usize) -> Self {
        Self::Unsigned(value as u64)
    }
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        let length = text.floor_char_boundary(TEXT_BYTES);
        let mut bytes = [0; TEXT_BYTES];
        bytes[..length].copy_from_slice(&text.as_bytes()[..length]);
        Self::Text(bytes, u8::try_from(length).unwrap_or(0))
    }
}

/// Writes a value as JSON, which people can read, too.
fn write_value(value: &Value, f: &mut Formatter<'_>) -> fmt::Result {
    match value {
        Value::Unsigned(number) => write!(f, "{number}"),
        Value::Signed(number) => write!(f, "{number}"),
        Value::Float(number) if number.is_finite() => write!(f, "{number:?}"),
        Value::Float(_) => f.write_str("null"),
        Value::Flag(truth) => write!(f, "{truth}"),
        Value::Text(bytes, length) => {
            let text = str::from_utf8(&bytes[..usize::from(*length)]);
            recording::write_json_text(text.unwrap_or(""), f)
        }
    }
}

/// Writes a time in seconds, with the digits that it has, so that times of lines are compared at a
/// glance.
fn write_seconds(ns: u64, f: &mut Formatter<'_>) -> fmt::Result {
    const SECOND_NS: u64 = 1_000_000_000;
    let (mut fraction, mut digits) = (ns % SECOND_NS, 9);
    write!(f, "{}", ns / SECOND_NS)?;
    if fraction > 0 {
        while fraction.is_multiple_of(10) {
            (fraction, digits) = (fraction / 10, digits - 1);
        }
        write!(f, ".{fraction:0digits$}")?;
    }
    f.write_str(" s")
}

/// A line that was said.
///
/// ```standalone_crate
/// use fass::log::take;
///
/// assert!(take().is_none(), "nothing was said");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Line {
    site: &'static Site,
    values: [Value; FIELDS],
    /// What makes a value's text, which only a program that says lines has.
    write: fn(&Value, &mut Formatter<'_>) -> fmt::Result,
    /// The instance that has said it, if one has.
    pub instance: Option<Instance>,
    /// When, on the time of the run, or of the one before if none goes on.
    pub at_ns: u64,
    /// How many lines had no room since the one that was taken before.
    pub left_out: u32,
}

impl Line {
    pub(crate) fn new(site: &'static Site, values: &[Value]) -> Self {
        Self {
            site,
            values: array::from_fn(|place| {
                values.get(place).copied().unwrap_or(Value::Flag(false))
            }),
            write: write_value,
            instance: None,
            at_ns: 0,
            left_out: 0,
        }
    }

    /// Returns its level.
    ///
    /// See [`Line`].
    #[must_use]
    pub const fn level(&self) -> Level {
        self.site.level
    }

    /// Returns its text, without the fields.
    ///
    /// See [`Line`].
    #[must_use]
    pub const fn text(&self) -> &'static str {
        self.site.text
    }

    /// Returns the keys and the values of its fields, which are JSON.
    ///
    /// See [`Line`].
    pub fn fields(&self) -> impl Iterator<Item = (&'static str, impl Display)> {
        let values = self
            .values
            .iter()
            .map(|value| fmt::from_fn(|f| (self.write)(value, f)));
        self.site.keys.iter().copied().zip(values)
    }

    /// Returns the names of its DAG and its subtask, and the instance, if it is of one of these
    /// DAGs.
    ///
    /// See [`Line`].
    #[must_use]
    pub fn names<'t>(&self, task_set: Option<&'t TaskSet>) -> Option<(&'t str, &'t str, Instance)> {
        let instance = self.instance?;
        let dag = task_set?.dags().get(instance.dag.index())?;
        let subtask = dag.subtasks().get(instance.subtask.index())?;
        Some((dag.name(), subtask.name(), instance))
    }

    /// Returns the line for people.
    ///
    /// See [`log!`](crate::log!).
    pub fn shown<'s>(&'s self, task_set: Option<&'s TaskSet>) -> impl Display + 's {
        fmt::from_fn(move |f| {
            write!(f, "{} ", self.level().word())?;
            if let Some((dag, subtask, Instance { job, .. })) = self.names(task_set) {
                write!(f, "{dag}/{subtask}[{job}] ")?;
            }
            write_seconds(self.at_ns, f)?;
            write!(f, ": {}", self.text())?;
            for (key, value) in self.fields() {
                write!(f, " {key}={value}")?;
            }
            match self.left_out {
                0 => Ok(()),
                count => write!(f, " ({count} lines before it had no room)"),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_text_for_people_with_values_that_are_json() {
        static SITE: Site = Site::new(Level::Warn, "camera late", &["by_ns", "of"]);
        let line = Line {
            at_ns: 1_500_000_000,
            left_out: 2,
            ..Line::new(&SITE, &[300.into(), "left \"eye\"".into()])
        };
        let expected = "warn 1.5 s: camera late by_ns=300 of=\"left \\\"eye\\\"\" \
                        (2 lines before it had no room)";
        assert_eq!(line.shown(None).to_string(), expected);
        let shown = |value: Value| fmt::from_fn(|f| write_value(&value, f)).to_string();
        let long = "ein sehr langer, kühler Text";
        assert_eq!(shown(long.into()), "\"ein sehr langer, kühler\"");
        assert_eq!(shown((-3).into()), "-3");
        let others = [0.5.into(), f64::NAN.into(), true.into(), 7_usize.into()];
        assert_eq!(others.map(shown), ["0.5", "null", "true", "7"]);
    }

    #[test]
    fn times_have_the_digits_that_they_need() {
        let shown = |ns| fmt::from_fn(|f| write_seconds(ns, f)).to_string();
        let times = [0, 7, 10_000_000, 1_020_000_000, 60_000_000_000].map(shown);
        assert_eq!(times, ["0 s", "0.000000007 s", "0.01 s", "1.02 s", "60 s"]);
    }
}
