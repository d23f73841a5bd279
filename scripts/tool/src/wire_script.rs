//! Bytes with their times, in the form of a file for `run --input`.
//!
//! Each line is a time of the run and bytes, as text in quotation marks or as hexadecimal pairs:
//!
//! ```text
//! # A radar says how far the car ahead is.
//! 4ms "gap 2350\n"
//! 1500us 67 61 70 0a
//! ```
//!
//! In quotation marks `\n`, `\r`, `\t`, `\0`, `\"` and `\\` stand for bytes, and `\x` with two
//! hexadecimal digits for any byte. Lines that begin with `#`, and empty lines, are ignored. Times
//! must not decrease. The guest gets entries: a time in nanoseconds, a length, and the bytes.

use fass_dag_file::time::parse_ns;
use text::visible;

/// The most bytes of a line: the guest takes them in one interrupt.
const MOST_BYTES: usize = 1024;

/// Bytes, and the time of the run at which they arrive.
pub type Entry = (u64, Vec<u8>);

/// Reads the text of such a file.
///
/// # Errors
///
/// In words that begin with the number of the line: the fault and the remedy.
pub fn read(text: &str) -> Result<Vec<Entry>, String> {
    let mut entries: Vec<Entry> = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let entry = entry(line).map_err(|why| format!("{number}: {why}"))?;
        // The guest delivers them in order, so an earlier time could not be met.
        if entries.last().is_some_and(|last| last.0 > entry.0) {
            return Err(format!(
                "{number}: this is before the line above; put the lines in the order of their times"
            ));
        }
        entries.push(entry);
    }
    Ok(entries)
}

fn entry(line: &str) -> Result<Entry, String> {
    let (time, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    let at_ns = parse_ns(time)?;
    let rest = rest.trim();
    let bytes = match rest.strip_prefix('"') {
        Some(text) => unescaped(text)?,
        None => rest
            .split_whitespace()
            .map(pair)
            .collect::<Result<_, _>>()?,
    };
    match bytes.len() {
        0 => Err(
            "there are no bytes; give a text such as \"on\\n\", or pairs such as 6f 6e 0a".into(),
        ),
        1..=MOST_BYTES => Ok((at_ns, bytes)),
        count => Err(format!(
            "{count} bytes arrive at once, and {MOST_BYTES} is the most; divide them, the time may \
             be the same"
        )),
    }
}

/// Reads the text after a quotation mark, up to the closing one.
fn unescaped(text: &str) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    let mut rest = text.chars();
    loop {
        let Some(letter) = rest.next() else {
            return Err("the text has no end; close it with \"".into());
        };
        match letter {
            '"' if rest.as_str().trim().is_empty() => return Ok(bytes),
            '"' => return Err("something follows the text; write one text in a line".into()),
            '\\' => bytes.push(escaped(&mut rest)?),
            letter => bytes.extend(letter.encode_utf8(&mut [0; 4]).bytes()),
        }
    }
}

fn escaped(rest: &mut std::str::Chars<'_>) -> Result<u8, String> {
    let name = rest.next();
    match name {
        Some('n') => Ok(b'\n'),
        Some('r') => Ok(b'\r'),
        Some('t') => Ok(b'\t'),
        Some('0') => Ok(0),
        Some(letter @ ('"' | '\\')) => Ok(letter as u8),
        Some('x') => {
            let digits: String = rest.by_ref().take(2).collect();
            pair(&digits)
        }
        _ => Err(
            "a backslash is followed by none of n, r, t, 0, x, \" and \\; double it to mean \
             itself"
                .into(),
        ),
    }
}

fn pair(digits: &str) -> Result<u8, String> {
    let is_pair = digits.len() == 2 && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    let byte = u8::from_str_radix(digits, 16).ok().filter(|_| is_pair);
    byte.ok_or_else(|| {
        format!(
            "`{}` is no pair of hexadecimal digits; write bytes such as 0a, or a text in \
             quotation marks",
            visible(digits)
        )
    })
}

/// Returns the entries as the guest takes them.
pub fn for_guest(entries: &[Entry]) -> Vec<u8> {
    let mut script = Vec::new();
    for (at_ns, bytes) in entries {
        // No entry is longer than 1024 bytes, see `MOST_BYTES`.
        let length = u16::try_from(bytes.len()).unwrap_or(u16::MAX);
        script.extend(at_ns.to_le_bytes());
        script.extend(length.to_le_bytes());
        script.extend(bytes);
    }
    script
}

#[cfg(test)]
mod tests {
    use super::{for_guest, read};
    use crate::tests::rows;

    #[test]
    fn texts_and_pairs_become_bytes_at_their_times() {
        let text = "# radar\n\n4ms \"gap 2350\\n\"\n4ms \"\\x00\\\"\\\\ \\r\\t\\0é\"  \n1s 67 0A\n";
        let entries = read(text).unwrap();
        let expected = [
            (4_000_000, &b"gap 2350\n"[..]),
            (4_000_000, b"\0\"\\ \r\t\0\xc3\xa9"),
            (1_000_000_000, b"g\n"),
        ];
        assert_eq!(
            entries,
            expected.map(|(at_ns, bytes)| (at_ns, bytes.to_vec()))
        );
        let script = for_guest(&entries[2..]);
        assert_eq!(script, b"\x00\xca\x9a\x3b\0\0\0\0\x02\0g\n");
    }

    /// Texts that are refused, and the reasons.
    const REFUSED: &str = r#"5 "a" | 1: `5` has no unit; append one of ns, us, ms and s
# a\nsoon 0a | 2: `soon` is no time
5ms | 1: there are no bytes; give a text
5ms "" | 1: there are no bytes; give a text
5ms "a | 1: the text has no end; close it
5ms "a" 0a | 1: something follows the text; write one
5ms "\q" | 1: a backslash is followed by none of
5ms "\x1" | 1: `1"` is no pair of hexadecimal digits; write
5ms 0a0 | 1: `0a0` is no pair of hexadecimal digits; write
5ms +1 | 1: `+1` is no pair
5ms 0a\n4ms 0a | 2: this is before the line above; put"#;

    #[test]
    fn what_is_wrong_is_told_with_its_line_and_the_remedy() {
        for [text, says] in rows(REFUSED) {
            let refused = read(&text).unwrap_err();
            assert!(refused.starts_with(&says), "{text}: {refused}");
        }
        let refused = read(&format!("5ms \"{}\"", "x".repeat(1025))).unwrap_err();
        assert!(refused.starts_with("1: 1025 bytes arrive at once"));
    }
}
