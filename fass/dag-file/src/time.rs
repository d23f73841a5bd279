//! Times in a DAG file: a whole number and its unit, such as `25ms`.
//!
//! Units are `ns`, `us` (also `µs`, as durations print it), `ms` and `s`. There is no
//! default unit: a number alone is refused, for nobody can know what it meant.

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
/// In words: it is negative, has no unit or an unknown one, or is beyond 64 bits
/// of nanoseconds.
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
        // The sign for micro, and the Greek letter that looks like it.
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

/// Reads a decimal number of units of `unit_ns`, in nanoseconds, as formats
/// without units have it. A part of a nanosecond is rounded to the safe side: up for what takes
/// time, and down for what has time, a period or a deadline.
///
/// # Errors
///
/// In words: it is no decimal number, is negative, or is beyond 64 bits of
/// nanoseconds.
pub fn scale_ns(word: &str, unit_ns: u64, rounds_up: bool) -> Result<u64, String> {
    let shown = quoted(word);
    if word.starts_with('-') {
        return Err(format!("{shown} is negative; give a time from 0 on"));
    }
    let (whole, fraction) = word.split_once('.').unwrap_or((word, "0"));
    let is_number = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    if !is_number(whole) || !is_number(fraction) {
        return Err(format!(
            "{shown} is no time; give a number such as 25 or 2.5"
        ));
    }
    // Beyond 18 digits a fraction tells less than a part of a nanosecond; what is not
    // 0 there may round the rest up.
    let (fraction, beyond) = fraction.split_at(fraction.len().min(18));
    let beyond = u128::from(beyond.bytes().any(|digit| digit != b'0'));
    let scaled = || {
        let whole_ns = whole
            .parse::<u128>()
            .ok()?
            .checked_mul(u128::from(unit_ns))?;
        let divisor = 10_u128.pow(u32::try_from(fraction.len()).ok()?);
        let part = fraction
            .parse::<u128>()
            .ok()?
            .checked_mul(u128::from(unit_ns))?
            .checked_add(beyond)?;
        let part_ns = match rounds_up {
            true => part.div_ceil(divisor),
            false => part / divisor,
        };
        u64::try_from(whole_ns.checked_add(part_ns)?).ok()
    };
    scaled().ok_or_else(|| {
        format!(
            "{shown} units of {} are more than 64 bits of nanoseconds hold; choose a shorter unit",
            Time(unit_ns)
        )
    })
}

/// A time as a DAG file has it: exactly, in the largest unit that divides it.
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

    #[test]
    fn numbers_without_unit_are_scaled() {
        for (text, unit_ns, up, down) in [
            ("73", 1_000_000, 73_000_000, 73_000_000),
            ("2.5", 1000, 2500, 2500),
            ("33.33333333", 1_000_000, 33_333_334, 33_333_333),
            ("0.0001", 1000, 1, 0),
            ("0.0000000000000000000000001", 1000, 1, 0),
            ("2.0000000000000000000000000", 1000, 2000, 2000),
        ] {
            let found = [true, false].map(|rounds_up| scale_ns(text, unit_ns, rounds_up));
            assert_eq!(found, [Ok(up), Ok(down)], "{text}");
        }
        for text in ["-2", "1e3", "", ".", "1.", "x"] {
            assert!(
                scale_ns(text, 1, true).unwrap_err().contains("give a"),
                "{text}"
            );
        }
        let message = scale_ns("18446744073710", 1_000_000, true).unwrap_err();
        assert!(
            message.contains("units of 1ms are more than 64 bits"),
            "{message}"
        );
    }
}
