//! The options of the kernel's command line: words `key=value`, separated by spaces.
//!
//! The kernel takes its own options and leaves the rest to the app. The app states the values
//! allowed for each of its options. An option taken by nobody is an error: a misspelt option must
//! not run with the default.

use core::cell::Cell;
use core::fmt;
use core::ops::RangeInclusive;

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

/// The kernel's own options, known to every app; `settings` takes them.
const KERNELS: [&str; 21] = [
    "policy",
    "preemption",
    "budget_factor",
    "overheads_ns",
    "wcets",
    "trace_events",
    "bounds",
    "events",
    "log",
    "measure",
    "idle",
    "console",
    "status",
    "mode",
    "probe",
    "end",
    "clock",
    "avx",
    "x2apic",
    "cores",
    "smt",
];

/// The command line, with a note of the options taken so far.
///
/// ```no_run
/// use kernel::options::CommandLine;
///
/// let options = CommandLine::parse("jobs=20 occupy=spin sizes=1,2")?;
/// assert_eq!(options.number("jobs", 1..=100, 50)?, 20);
/// assert_eq!(options.number("seed", 0..=9, 1)?, 1); // not given: the default
/// assert_eq!(options.numbers("sizes", 1..=4, &[1])?, [1, 2]);
/// assert!(options.choice("occupy", &[("hold", false), ("spin", true)])?);
/// options.finish(&["jobs", "seed", "sizes", "occupy"])?; // nothing is left over
/// # Ok::<(), kernel::options::UsageError>(())
/// ```
#[derive(Debug)]
pub struct CommandLine<'a> {
    words: Vec<OptionWord<'a>>,
}

#[derive(Debug)]
struct OptionWord<'a> {
    key: &'a str,
    value: &'a str,
    taken: Cell<bool>,
}

/// An error in the command line: the wrong option, and the values allowed.
///
/// See [`CommandLine::finish`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UsageError(String);

impl UsageError {
    /// Makes an error from a message with the wrong option and the values allowed.
    ///
    /// ```no_run
    /// use kernel::options::UsageError;
    ///
    /// let error = UsageError::new("`rate=3`: only even rates are possible");
    /// assert!(error.to_string().contains("rate=3"));
    /// ```
    pub fn new(message: impl Into<String>) -> Self {
        Self(message.into())
    }
}

impl fmt::Display for UsageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl core::error::Error for UsageError {}

impl<'a> CommandLine<'a> {
    /// Splits a command line into options.
    ///
    /// # Errors
    ///
    /// If a word is not of the form `key=value`, or a key occurs twice.
    pub fn parse(line: &'a str) -> Result<Self, UsageError> {
        let mut words = Vec::<OptionWord<'a>>::new();
        for word in line.split_whitespace() {
            let Some((key, value)) = word.split_once('=') else {
                return Err(UsageError(format!("`{word}` is not of the form key=value")));
            };
            if words.iter().any(|earlier| earlier.key == key) {
                return Err(UsageError(format!("`{key}` is given twice; give it once")));
            }
            words.push(OptionWord {
                key,
                value,
                taken: Cell::new(false),
            });
        }
        Ok(Self { words })
    }

    /// Takes the raw value of `key`, if the key is given.
    ///
    /// ```no_run
    /// let options = kernel::options::CommandLine::parse("map=town").unwrap();
    /// assert_eq!(options.text("map"), Some("town"));
    /// assert_eq!(options.text("seed"), None);
    /// ```
    pub fn text(&self, key: &str) -> Option<&'a str> {
        let word = self.words.iter().find(|word| word.key == key)?;
        word.taken.set(true);
        Some(word.value)
    }

    /// Takes the value of `key` as a whole number, or `default`.
    ///
    /// # Errors
    ///
    /// If the value is not a whole number within `allowed`.
    ///
    /// ```no_run
    /// let options = kernel::options::CommandLine::parse("jobs=0").unwrap();
    /// let error = options.number("jobs", 1..=100, 50).unwrap_err();
    /// assert_eq!(error.to_string(), "`jobs=0`: allowed are whole numbers from 1 to 100");
    /// ```
    pub fn number(
        &self,
        key: &str,
        allowed: RangeInclusive<u64>,
        default: u64,
    ) -> Result<u64, UsageError> {
        self.text(key)
            .map_or(Ok(default), |value| parse_number(key, value, &allowed))
    }

    /// Takes the value of `key` as whole numbers separated by commas, or `default`.
    ///
    /// # Errors
    ///
    /// If any part is not a whole number within `allowed`.
    pub fn numbers(
        &self,
        key: &str,
        allowed: RangeInclusive<u64>,
        default: &[u64],
    ) -> Result<Vec<u64>, UsageError> {
        self.text(key).map_or_else(
            || Ok(default.to_vec()),
            |value| {
                value
                    .split(',')
                    .map(|item| parse_number(key, item, &allowed))
                    .collect()
            },
        )
    }

    /// Takes the value of `key` as a name in `choices`, or the first name if the key is missing.
    ///
    /// # Errors
    ///
    /// If the value is not among the names.
    ///
    /// # Panics
    ///
    /// If there are no choices.
    pub fn choice<T: Copy>(&self, key: &str, choices: &[(&str, T)]) -> Result<T, UsageError> {
        let name = |place: usize| choices.get(place).map(|(name, _)| *name);
        Ok(choices[self.chosen(key, &name)?].1)
    }

    /// Returns the index of the name given as the value of `key`, or 0 if the key is missing. All
    /// kinds of choices share this function, because an image has little room.
    #[inline(never)]
    fn chosen<'n>(
        &self,
        key: &str,
        name: &dyn Fn(usize) -> Option<&'n str>,
    ) -> Result<usize, UsageError> {
        let Some(value) = self.text(key) else {
            return Ok(0);
        };
        let names = || (0..).map_while(name);
        names().position(|name| name == value).ok_or_else(|| {
            let names: Vec<_> = names().collect();
            UsageError(format!("`{key}={value}`: allowed are {}", names.join(", ")))
        })
    }

    /// Checks that every option has been taken; `known` are the app's keys.
    ///
    /// # Errors
    ///
    /// If an option has not been taken. The error names the option and, unless the option is one of
    /// the kernel's own, all existing keys.
    ///
    /// ```no_run
    /// let options = kernel::options::CommandLine::parse("sed=3").unwrap();
    /// let _ = options.number("seed", 0..=9, 1);
    /// let error = options.finish(&["seed"]).unwrap_err();
    /// assert!(error.to_string().starts_with("`sed` is no option; there are seed, "));
    /// ```
    pub fn finish(&self, known: &[&str]) -> Result<(), UsageError> {
        let Some(word) = self.words.iter().find(|word| !word.taken.get()) else {
            return Ok(());
        };
        if KERNELS.contains(&word.key) {
            let line = format!("`{}` means nothing here; leave it out", word.key);
            return Err(UsageError(line));
        }
        let (own, kernels) = (known.join(", "), KERNELS.join(", "));
        Err(UsageError(format!(
            "`{}` is no option; there are {own}, and for every app {kernels}",
            word.key
        )))
    }
}

fn parse_number(key: &str, value: &str, allowed: &RangeInclusive<u64>) -> Result<u64, UsageError> {
    whole_number(value)
        .filter(|number| allowed.contains(number))
        .ok_or_else(|| {
            let (low, high) = (allowed.start(), allowed.end());
            UsageError(format!(
                "`{key}={value}`: allowed are whole numbers from {low} to {high}"
            ))
        })
}

/// Reads a whole number: digits alone, without the sign accepted by `parse`.
pub fn whole_number(text: &str) -> Option<u64> {
    let is_whole = text.bytes().all(|byte| byte.is_ascii_digit());
    is_whole.then(|| text.parse().ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message<T: fmt::Debug>(result: Result<T, UsageError>) -> String {
        result.unwrap_err().to_string()
    }

    #[test]
    fn takes_words_and_falls_back_to_defaults() {
        let options = CommandLine::parse("jobs=20  policy=edf subtasks=2,4").unwrap();
        assert_eq!(options.number("jobs", 1..=100, 5), Ok(20));
        assert_eq!(options.number("seed", 0..=9, 5), Ok(5));
        assert_eq!(
            options.choice("policy", &[("static", 1), ("edf", 2)]),
            Ok(2)
        );
        assert_eq!(options.choice("occupy", &[("hold", 1), ("spin", 2)]), Ok(1));
        assert_eq!(options.numbers("subtasks", 1..=16, &[6]), Ok(vec![2, 4]));
        assert_eq!(options.finish(&["jobs"]), Ok(()));
    }

    #[test]
    fn names_the_word_and_what_is_allowed() {
        let options = CommandLine::parse("jobs=0 policy=lifo sed=1 subtasks=2,x").unwrap();
        let wrong = message(options.number("jobs", 1..=100, 5));
        assert_eq!(wrong, "`jobs=0`: allowed are whole numbers from 1 to 100");
        let wrong = message(options.choice("policy", &[("static", 1), ("edf", 2)]));
        assert_eq!(wrong, "`policy=lifo`: allowed are static, edf");
        let wrong = message(options.numbers("subtasks", 1..=16, &[]));
        assert_eq!(
            wrong,
            "`subtasks=x`: allowed are whole numbers from 1 to 16"
        );
        let wrong = message(options.finish(&["jobs", "seed"]));
        assert_eq!(
            wrong,
            "`sed` is no option; there are jobs, seed, and for every app policy, preemption, \
             budget_factor, overheads_ns, wcets, trace_events, bounds, events, log, measure, idle, \
             console, status, mode, probe, end, clock, avx, x2apic, cores, smt"
        );
        // Another system takes it.
        let wrong = message(CommandLine::parse("idle=halt").unwrap().finish(&["jobs"]));
        assert_eq!(wrong, "`idle` means nothing here; leave it out");
    }

    #[test]
    fn a_number_has_digits_alone() {
        for (text, number) in [("5", Some(5)), ("007", Some(7)), ("+5", None), ("-5", None)] {
            assert_eq!(whole_number(text), number, "{text}");
        }
        for text in ["", " 5", "5 ", "1e3", "0x5", "18446744073709551616"] {
            assert_eq!(whole_number(text), None, "{text}");
        }
        let options = CommandLine::parse("jobs=+5").unwrap();
        assert!(options.number("jobs", 1..=9, 5).is_err());
    }

    #[test]
    fn refuses_lines_that_are_not_words() {
        assert_eq!(
            message(CommandLine::parse("jobs")),
            "`jobs` is not of the form key=value"
        );
        assert_eq!(
            message(CommandLine::parse("a=1 a=2")),
            "`a` is given twice; give it once"
        );
    }
}
