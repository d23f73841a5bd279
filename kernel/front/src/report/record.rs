//! The record of a boot as machine lines, where nothing else takes it.

use core::fmt::{self, Write};

use fass::edge::Sink;

use crate::text::json;

/// How many bytes a line has; a multiple of three, so that only the last one is padded.
const LINE_BYTES: usize = 768;

/// Prints a record, by the line.
#[derive(Debug)]
pub struct Lines {
    bytes: [u8; LINE_BYTES],
    length: usize,
}

impl Lines {
    /// Begins with nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            bytes: [0; LINE_BYTES],
            length: 0,
        }
    }

    /// Prints what waits for a line to be full.
    pub fn flush(&mut self) {
        let bytes = &self.bytes[..core::mem::take(&mut self.length)];
        if !bytes.is_empty() {
            json::report("record", |line| {
                line.text("bytes", in_base64(bytes));
            });
        }
    }
}

impl Default for Lines {
    fn default() -> Self {
        Self::new()
    }
}

impl Sink for Lines {
    fn put(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let count = bytes.len().min(LINE_BYTES - self.length);
            let (now, later) = bytes.split_at(count);
            self.bytes[self.length..self.length + count].copy_from_slice(now);
            self.length += count;
            bytes = later;
            if self.length == LINE_BYTES {
                self.flush();
            }
        }
    }
}

/// Writes bytes as RFC 4648 has it, section 4.
fn in_base64(bytes: &[u8]) -> impl fmt::Display {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    fmt::from_fn(move |f| {
        bytes.chunks(3).try_for_each(|three| {
            let byte = |place: usize| u32::from(three.get(place).copied().unwrap_or(0));
            let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
            (0..4).try_for_each(|digit| match digit <= three.len() {
                true => {
                    let place = bits >> (18 - 6 * digit) & 63;
                    f.write_char(char::from(DIGITS[place as usize]))
                }
                false => f.write_char('='),
            })
        })
    })
}

#[cfg(test)]
mod tests {
    use super::in_base64;

    #[test]
    fn bytes_are_written_as_the_standard_has_it() {
        let rows = [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ];
        for (bytes, text) in rows {
            assert_eq!(in_base64(bytes.as_bytes()).to_string(), text);
        }
    }
}
