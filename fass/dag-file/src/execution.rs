//! Execution times derived from a file, as chosen by a word of the command line.

use alloc::format;
use alloc::string::String;

use text::quoted;

/// A millionth, the finest fraction of a WCET.
pub const WHOLE: u64 = 1_000_000;

/// How execution times follow from the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Execution {
    /// Every instance takes its WCET.
    Wcet,
    /// Uniformly distributed between two fractions of the WCET, in millionths.
    Uniform {
        /// The smallest fraction.
        least: u64,
        /// The largest fraction, at most a whole.
        most: u64,
    },
    /// One of the subtask's samples, each with the same probability; the WCET for a subtask without
    /// samples.
    Samples,
    /// The samples in their order, job by job, and again from the first sample; the WCET for a
    /// subtask without samples.
    Sequence,
}

impl Execution {
    /// The forms accepted by [`parse`](Self::parse), for messages.
    pub const FORMS: &'static str =
        "wcet, uniform:0.2..1 (fractions of the WCET), samples or sequence";

    /// Reads `wcet`, `uniform:LO..HI` with fractions of the WCET, `samples` or `sequence`.
    ///
    /// # Errors
    ///
    /// In words: the text is none of them, or the fractions are not a range within 0 to 1.
    pub fn parse(text: &str) -> Result<Self, String> {
        match text {
            "wcet" => return Ok(Self::Wcet),
            "samples" => return Ok(Self::Samples),
            "sequence" => return Ok(Self::Sequence),
            _ => {}
        }
        let range = text.strip_prefix("uniform:").and_then(|range| {
            let (least, most) = range.split_once("..")?;
            Some((fraction(least)?, fraction(most)?))
        });
        match range {
            Some((least, most)) if least <= most && most <= WHOLE => {
                Ok(Self::Uniform { least, most })
            }
            Some(_) => Err(format!(
                "{}: the fractions must rise and be 1 at most, as in uniform:0.2..1",
                quoted(text)
            )),
            None => Err(format!("{}: give {}", quoted(text), Self::FORMS)),
        }
    }
}

/// Reads a decimal fraction of up to six digits, in millionths.
fn fraction(text: &str) -> Option<u64> {
    let (whole, part) = text.split_once('.').unwrap_or((text, "0"));
    let is_number = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    if !is_number(whole) || !is_number(part) || part.len() > 6 {
        return None;
    }
    let whole: u64 = whole.parse().ok()?;
    let missing = u32::try_from(6 - part.len()).ok()?;
    let part: u64 = part.parse().ok()?;
    whole
        .checked_mul(WHOLE)?
        .checked_add(part * 10_u64.pow(missing))
}

/// Returns the kernel's worst overheads in nanoseconds, measured in deterministic mode: of a
/// context switch, a dispatch, an interrupt, and an instance becoming ready. A dispatch may wait
/// for the dispatches of all other cores, since cores take turns.
#[must_use]
pub const fn kernel_overheads_ns(cores: u64) -> [u64; 4] {
    [1000, 2500 * cores, 4000, 1000]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_are_read() {
        assert_eq!(Execution::parse("wcet"), Ok(Execution::Wcet));
        assert_eq!(Execution::parse("samples"), Ok(Execution::Samples));
        assert_eq!(Execution::parse("sequence"), Ok(Execution::Sequence));
        let (least, most) = (250_000, WHOLE);
        let uniform = Ok(Execution::Uniform { least, most });
        assert_eq!(Execution::parse("uniform:0.25..1"), uniform);
        assert_eq!(Execution::parse("uniform:0.250..1.0"), uniform);
        for (texts, words) in [
            (
                "uniform uniform:1 uniform:a..1 uniform:-1..1 average",
                "give wcet, ",
            ),
            ("uniform:1..0.5 uniform:0..1.000001", "must rise"),
        ] {
            for text in texts.split(' ') {
                let refused = Execution::parse(text).unwrap_err();
                assert!(refused.contains(words), "{text}");
            }
        }
        assert!(Execution::parse("").is_err());
    }
}
