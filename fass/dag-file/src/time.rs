//! Times in a DAG file: a whole number and its unit, such as `25ms`.
//!
//! Units are `ns`, `us` (also `µs`, the form printed for durations), `ms` and `s`. There is no
//! default unit: a number alone is refused, since nobody can know its meaning.

use alloc::format;
use alloc::string::String;
use core::fmt;

use text::quoted;

const UNITS: [(&str, u64); 4] = [
    ("ns", 1),
    ("us", 1_000),
    ("ms", 1_000_000),
    ("s", 1_000_000_000),
];

/// Reads a time, in nanoseconds.
///
/// # Errors
///
/// In words: the time is negative, has no unit or an unknown one, or is beyond 64 bits of
/// nanoseconds.
pub fn parse_ns(word: &str) -> Result<u64, String> {
    let shown = quoted(word);
    if word.starts_with('-') {
        return Err(format!("{shown} is negative; give a time from 0 on"));
    }
    let digits = word.bytes().take_while(u8::is_ascii_digit).count();
    let (number, unit) = word.split_at(digits);
    if number.is_empty() {
        return Err(format!(
            "{shown} is no time; give a whole number with its unit, such as 25ms"
        ));
    }
    if unit.is_empty() {
        return Err(format!(
            "{shown} has no unit; append one of ns, us, ms and s"
        ));
    }
    let name = match unit {
        // The sign for micro, and the similar Greek letter.
        "\u{b5}s" | "\u{3bc}s" => "us",
        other => other,
    };
    let known = UNITS.iter().find(|(known, _)| *known == name);
    let Some((_, unit_ns)) = known else {
        return Err(format!(
            "{shown} is no time: {} is no unit; write a whole number and one of ns, us, ms and s",
            quoted(unit)
        ));
    };
    let ns = number
        .parse()
        .ok()
        .and_then(|count: u64| count.checked_mul(*unit_ns));
    ns.ok_or_else(|| {
        format!("{shown} is more than 64 bits of nanoseconds hold; give at most 584 years")
    })
}

/// A time in the form of a DAG file: exact, in the largest unit dividing the time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Time(
    /// Nanoseconds.
    pub u64,
);

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let divides = |(_, unit_ns): &&(&str, u64)| self.0.is_multiple_of(*unit_ns);
        let (name, unit_ns) = UNITS.iter().rev().find(divides).unwrap_or(&UNITS[0]);
        if self.0 == 0 {
            return f.write_str("0ns");
        }
        write!(f, "{}{name}", self.0 / unit_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_and_written() {
        for (text, ns) in [
            ("0ns", 0),
            ("7ns", 7),
            ("1500us", 1_500_000),
            ("25ms", 25_000_000),
            ("3s", 3_000_000_000),
            ("18446744073709551615ns", u64::MAX),
        ] {
            assert_eq!(parse_ns(text), Ok(ns));
            assert_eq!(Time(ns).to_string(), text);
        }
        assert_eq!(Time(2_000_000).to_string(), "2ms");
        assert_eq!(parse_ns("3\u{b5}s"), Ok(3000));
        assert_eq!(parse_ns("3\u{3bc}s"), Ok(3000));
    }

    #[test]
    fn what_is_no_time_is_refused_in_words() {
        for (text, words) in [
            ("-1ms", "`-1ms` is negative"),
            ("25", "`25` has no unit; append one of ns, us, ms and s"),
            ("ms", "`ms` is no time"),
            ("1.5ms", "`.5ms` is no unit"),
            ("3min", "`min` is no unit"),
            ("+3ms", "`+3ms` is no time"),
            ("18446744073709551616ns", "more than 64 bits"),
            ("18446744074s", "more than 64 bits"),
        ] {
            let message = parse_ns(text).unwrap_err();
            assert!(message.contains(words), "{message}");
        }
    }
}
