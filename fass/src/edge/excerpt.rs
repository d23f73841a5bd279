//! The beginning of a text, in memory allocated in advance.
//!
//! The text of a panic is the app's: it may have megabytes, and there may be no memory left. A
//! report shows as much of it as fits here, and counts the rest.

use core::fmt::{self, Display, Write};

/// The first bytes of a text, up to `N` of them.
#[derive(Debug)]
pub struct Excerpt<const N: usize> {
    bytes: [u8; N],
    length: usize,
    /// The number of bytes left out.
    left_out: u64,
}

impl<const N: usize> Excerpt<N> {
    /// Makes the text of a value, and keeps its beginning.
    pub fn of(value: impl Display) -> Self {
        let mut excerpt = Self {
            bytes: [0; N],
            length: 0,
            left_out: 0,
        };
        // Only the value itself can fail; then its text up to there is all there is.
        let _ = write!(excerpt, "{value}");
        excerpt
    }
}

impl<const N: usize> Write for Excerpt<N> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        // After a gap nothing is kept, as the text shown must be a beginning.
        let room = if self.left_out > 0 {
            0
        } else {
            N - self.length
        };
        // The place is a character boundary, so the split succeeds; code for a panic would be
        // large.
        let cut = text.split_at_checked(text.floor_char_boundary(room));
        let (kept, left_out) = cut.unwrap_or_default();
        self.bytes[self.length..self.length + kept.len()].copy_from_slice(kept.as_bytes());
        self.length += kept.len();
        self.left_out += left_out.len() as u64;
        Ok(())
    }
}

impl<const N: usize> Display for Excerpt<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Whole characters were copied, so the conversion succeeds.
        f.write_str(core::str::from_utf8(&self.bytes[..self.length]).unwrap_or_default())?;
        match self.left_out {
            0 => Ok(()),
            count => write!(f, " ... and {count} more bytes"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fits_is_shown_and_the_rest_is_counted() {
        assert_eq!(Excerpt::<4>::of("abcd").to_string(), "abcd");
        assert_eq!(Excerpt::<4>::of("").to_string(), "");
        let cut = Excerpt::<4>::of("abcdef").to_string();
        assert_eq!(cut, "abcd ... and 2 more bytes");
        // A character that does not fit is left out whole, and all behind it.
        assert_eq!(
            Excerpt::<4>::of("abc€d").to_string(),
            "abc ... and 4 more bytes"
        );
        let parts = fmt::from_fn(|f| {
            f.write_str("abc")?;
            f.write_str("€")?;
            f.write_str("d")
        });
        assert_eq!(
            Excerpt::<4>::of(parts).to_string(),
            "abc ... and 4 more bytes"
        );
    }
}
