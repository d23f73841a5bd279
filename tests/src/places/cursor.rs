//! A place in a section of debugging information, from which its numbers are read.
//!
//! Whatever lies beyond the section's end is `None`: an image without whole
//! debugging information has none.

/// Reads on and on.
#[derive(Clone, Debug)]
pub(super) struct Cursor<'f> {
    rest: &'f [u8],
}

impl<'f> Cursor<'f> {
    /// Begins at an offset in a section.
    pub(super) fn at(section: &'f [u8], offset: u64) -> Option<Cursor<'f>> {
        let rest = section.get(usize::try_from(offset).ok()?..)?;
        Some(Cursor { rest })
    }

    pub(super) const fn is_at_end(&self) -> bool {
        self.rest.is_empty()
    }

    /// Takes so many bytes, to be read by themselves.
    pub(super) fn take(&mut self, bytes: u64) -> Option<Cursor<'f>> {
        let (taken, rest) = self.rest.split_at_checked(usize::try_from(bytes).ok()?)?;
        self.rest = rest;
        Some(Cursor { rest: taken })
    }

    /// Reads a number of so many bytes, the least significant first.
    pub(super) fn number(&mut self, bytes: u64) -> Option<u64> {
        let taken = self.take(bytes)?.rest.iter().rev();
        Some(taken.fold(0, |sum, byte| sum << 8 | u64::from(*byte)))
    }

    /// Reads a number in LEB128 (DWARF 4, section 7.6).
    pub(super) fn uleb(&mut self) -> Option<u64> {
        Some(self.leb()?.0)
    }

    /// Reads a signed number in LEB128.
    pub(super) fn sleb(&mut self) -> Option<i64> {
        let (value, bits) = self.leb()?;
        let unused = 64_u32.saturating_sub(bits);
        Some((value << unused).cast_signed() >> unused)
    }

    fn leb(&mut self) -> Option<(u64, u32)> {
        let (mut value, mut bits) = (0, 0);
        loop {
            let byte = self.number(1)?;
            value |= (byte & 0x7f).checked_shl(bits).unwrap_or(0);
            bits += 7;
            if byte & 0x80 == 0 {
                return Some((value, bits));
            }
        }
    }

    /// Reads a text that ends before a zero byte.
    pub(super) fn text(&mut self) -> Option<&'f str> {
        let length = self.rest.iter().position(|byte| *byte == 0)?;
        let (text, rest) = self.rest.split_at(length);
        self.rest = &rest[1..];
        str::from_utf8(text).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::Cursor;

    #[test]
    fn numbers_and_texts_are_read_one_after_the_other() {
        // The numbers of LEB128 are the examples of DWARF 4, figures 22 and 23.
        let bytes = b"\x34\x12\x80\x7f\x80\x01\xb9\x64abc\0";
        let mut cursor = Cursor::at(bytes, 0).unwrap();
        assert_eq!(cursor.number(2), Some(0x1234));
        assert_eq!(cursor.sleb(), Some(-128));
        assert_eq!(cursor.uleb(), Some(128));
        assert_eq!(cursor.uleb(), Some(12857));
        assert_eq!(cursor.text(), Some("abc"));
        assert!(cursor.is_at_end());
        assert_eq!(cursor.number(1), None);
    }
}
