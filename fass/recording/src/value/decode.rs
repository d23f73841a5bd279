//! Reading bytes that may be anything.

use core::fmt;

/// Reads values one after the other, and trusts none of its bytes.
///
/// ```
/// use recording::{Decoder, Recordable};
///
/// let mut input = Decoder::new(&[1, 2, 1, 2]);
/// assert_eq!(Option::<u16>::decode(&mut input), Ok(Some(258)));
/// let malformed = bool::decode(&mut input).unwrap_err();
/// assert_eq!(malformed.to_string(), "at byte 3: expected a truth value, 0 or 1");
/// ```
#[derive(Clone, Debug)]
pub struct Decoder<'b> {
    bytes: &'b [u8],
    offset: usize,
}

/// Bytes that are no value of the type, or no recording.
///
/// See [`Decoder`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Malformed {
    /// The offset of the first byte of what is wrong.
    pub offset: usize,
    /// What was expected there.
    pub expected: &'static str,
}

impl<'b> Decoder<'b> {
    /// Begins at the start of these bytes.
    ///
    /// See [`Decoder`].
    #[must_use]
    pub const fn new(bytes: &'b [u8]) -> Self {
        Self { bytes, offset: 0 }
    }

    /// Returns the offset of the next byte.
    ///
    /// See [`Malformed`].
    #[must_use]
    pub const fn offset(&self) -> usize {
        self.offset
    }

    /// Returns how many bytes are left.
    ///
    /// ```
    /// assert_eq!(recording::Decoder::new(&[1, 2]).remaining(), 2);
    /// ```
    #[must_use]
    pub const fn remaining(&self) -> usize {
        self.bytes.len() - self.offset
    }

    /// Takes the next bytes as they are.
    ///
    /// # Errors
    ///
    /// There are fewer; `expected` says what they would have been.
    ///
    /// ```
    /// let mut input = recording::Decoder::new(&[1, 2, 3]);
    /// assert_eq!(input.take(2, "two bytes"), Ok(&[1, 2][..]));
    /// assert_eq!(input.take(2, "two more").unwrap_err().offset, 2);
    /// ```
    pub fn take(&mut self, count: usize, expected: &'static str) -> Result<&'b [u8], Malformed> {
        match self.bytes[self.offset..].get(..count) {
            Some(taken) => {
                self.offset += count;
                Ok(taken)
            }
            None => Err(self.expected(expected)),
        }
    }

    /// Takes the next bytes as an array.
    pub(crate) fn array<const N: usize>(
        &mut self,
        expected: &'static str,
    ) -> Result<[u8; N], Malformed> {
        let offset = self.offset;
        let taken = self.take(N, expected)?;
        (taken.try_into()).map_err(|_| Malformed { offset, expected })
    }

    /// Takes how many elements follow, each of which takes so many bytes or more. So there are
    /// never more than the bytes that are left.
    pub(crate) fn count(&mut self, least_bytes: usize) -> Result<usize, Malformed> {
        let expected = "how many elements follow, as many as there are bytes for";
        let offset = self.offset;
        let count = u32::from_le_bytes(self.array(expected)?);
        let count = usize::try_from(count).unwrap_or(usize::MAX);
        match count.checked_mul(least_bytes.max(1)) {
            Some(bytes) if bytes <= self.remaining() => Ok(count),
            _ => Err(Malformed { offset, expected }),
        }
    }

    /// Makes sure that nothing is left.
    ///
    /// # Errors
    ///
    /// Something is.
    ///
    /// ```
    /// let input = recording::Decoder::new(&[1]);
    /// assert_eq!(input.end().unwrap_err().expected, "the end of the value");
    /// ```
    pub fn end(&self) -> Result<(), Malformed> {
        match self.remaining() {
            0 => Ok(()),
            _ => Err(self.expected("the end of the value")),
        }
    }

    /// Says what was expected at the next byte.
    pub(crate) const fn expected(&self, expected: &'static str) -> Malformed {
        Malformed {
            offset: self.offset,
            expected,
        }
    }
}

impl Malformed {
    /// Returns the same for bytes that stand behind others.
    pub(crate) const fn behind(self, bytes: usize) -> Self {
        Self {
            offset: self.offset + bytes,
            ..self
        }
    }
}

impl fmt::Display for Malformed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at byte {}: expected {}", self.offset, self.expected)
    }
}

impl core::error::Error for Malformed {}
