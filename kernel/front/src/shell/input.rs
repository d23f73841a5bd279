//! Puts the bytes typed by a person together into lines.

/// The longest line, in bytes.
const LONGEST: usize = 120;

const BACKSPACE: u8 = 0x08;
const DELETE: u8 = 0x7f;

/// A line being typed.
pub(super) struct LineEditor {
    bytes: [u8; LONGEST],
    length: usize,
    is_too_long: bool,
    /// The length of the latest complete line, 0 once the next line has begun.
    complete: usize,
}

/// The effect of a typed byte.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum TypedByte<'a> {
    /// The line is not complete yet, or is empty.
    Nothing,
    /// The line is complete.
    Line(&'a str),
    /// The line is complete, but longer than a line may be.
    TooLong,
    /// The line is complete, but not UTF-8.
    NotText,
}

impl LineEditor {
    pub(super) const fn new() -> Self {
        Self {
            bytes: [0; LONGEST],
            length: 0,
            is_too_long: false,
            complete: 0,
        }
    }

    /// Returns the latest complete line, unless another line has begun.
    pub(super) fn line(&self) -> &str {
        let line = core::str::from_utf8(&self.bytes[..self.complete]);
        line.map_or("", str::trim)
    }

    /// Takes a byte. A line ends with `\r` or `\n`. An empty line does not count, and so `\r\n`
    /// ends a single line.
    pub(super) fn on_byte(&mut self, byte: u8) -> TypedByte<'_> {
        match byte {
            b'\r' | b'\n' => {
                let length = core::mem::take(&mut self.length);
                self.complete = length;
                if core::mem::take(&mut self.is_too_long) {
                    return TypedByte::TooLong;
                }
                match core::str::from_utf8(&self.bytes[..length]).map(str::trim) {
                    Ok("") => TypedByte::Nothing,
                    Ok(line) => TypedByte::Line(line),
                    Err(_) => TypedByte::NotText,
                }
            }
            BACKSPACE | DELETE => {
                self.length = self.length.saturating_sub(1);
                TypedByte::Nothing
            }
            byte => {
                self.complete = 0;
                match self.bytes.get_mut(self.length) {
                    Some(place) => {
                        *place = byte;
                        self.length += 1;
                    }
                    None => self.is_too_long = true,
                }
                TypedByte::Nothing
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Types all and returns what came of it in words.
    fn typed(text: &[u8]) -> Vec<String> {
        let mut input = LineEditor::new();
        let mut lines = Vec::new();
        for byte in text {
            match input.on_byte(*byte) {
                TypedByte::Nothing => {}
                TypedByte::Line(line) => lines.push(line.into()),
                TypedByte::TooLong => lines.push("(too long)".into()),
                TypedByte::NotText => lines.push("(not text)".into()),
            }
        }
        lines
    }

    #[test]
    fn a_line_ends_with_any_line_end_and_empty_ones_are_nothing() {
        assert_eq!(
            typed(b"one\rtwo\nthree\r\n\n  \n four \nfi"),
            ["one", "two", "three", "four"]
        );
    }

    #[test]
    fn a_line_stays_until_the_next_one_begins() {
        let mut input = LineEditor::new();
        b" stats \n".iter().for_each(|byte| {
            input.on_byte(*byte);
        });
        assert_eq!(input.line(), "stats");
        input.on_byte(b'x');
        assert_eq!(input.line(), "");
    }

    #[test]
    fn what_is_typed_wrongly_can_be_taken_back() {
        assert_eq!(typed(b"\x7fhelx\x08p\n"), ["help"]);
    }

    #[test]
    fn a_line_too_long_or_no_text_is_refused_as_a_whole() {
        let long = [b'x'; LONGEST + 1];
        let mut text = long.to_vec();
        text.extend(b"\nhelp\n\xff\ndags\n");
        assert_eq!(typed(&text), ["(too long)", "help", "(not text)", "dags"]);
        text.truncate(LONGEST);
        text.push(b'\n');
        assert_eq!(typed(&text)[0].len(), LONGEST);
    }
}
