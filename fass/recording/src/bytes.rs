//! Bytes: written into a given buffer, and read without any trust in them.

use core::fmt;

/// Writes values one after the other into a buffer, and counts the bytes that do not fit. The
/// type's parameter chooses one of the two forms, so recording has no code for the other form.
///
/// ```
/// use recording::{Encoder, Full, Recordable};
///
/// let mut buffer = [0; 4];
/// let mut out = Encoder::new(&mut buffer);
/// (7_u8, 0x0102_u16).encode(&mut out);
/// assert_eq!(out.finish(), Ok(3));
/// assert_eq!(buffer, [7, 2, 1, 0]);
///
/// let mut out = Encoder::new(&mut buffer);
/// 1.5_f64.encode(&mut out);
/// assert_eq!(out.finish(), Err(Full { needed: 8 }));
/// ```
#[derive(Debug)]
pub struct Encoder<'b, const CDR: bool = false> {
    buffer: &'b mut [u8],
    /// The bytes so far, including those that did not fit; `usize::MAX`: more than possible.
    written: usize,
}

/// A buffer is too small for the values.
///
/// See [`Encoder`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Full {
    /// The bytes needed.
    pub needed: usize,
}

impl<'b> Encoder<'b> {
    /// Begins at the start of a buffer.
    #[inline]
    pub const fn new(buffer: &'b mut [u8]) -> Self {
        Self { buffer, written: 0 }
    }
}

impl<'b> Encoder<'b, true> {
    /// Begins a value in the form of [CDR](crate#cdr).
    #[must_use]
    pub const fn cdr(buffer: &'b mut [u8]) -> Self {
        Self { buffer, written: 0 }
    }
}

impl<const CDR: bool> Encoder<'_, CDR> {
    /// Aligns the next bytes to their size, if the form requires alignment.
    #[inline]
    pub(crate) fn align(&mut self, bytes: usize) {
        if CDR && let Some(places) = self.places(padding(self.written, bytes)) {
            places.fill(0);
        }
    }

    /// Writes text, preceded by its length in bytes.
    pub(crate) fn text(&mut self, text: &str) {
        self.count(text.len() + usize::from(CDR));
        self.put(text.as_bytes());
        if CDR {
            self.put(&[0]);
        }
    }

    /// Writes bytes as they are.
    #[inline]
    pub fn put(&mut self, bytes: &[u8]) {
        if let Some(places) = self.places(bytes.len()) {
            places.copy_from_slice(bytes);
        }
    }

    /// Returns the place of the next `count` bytes, to be filled; `None` if they do not fit.
    #[inline]
    pub(crate) fn places(&mut self, count: usize) -> Option<&mut [u8]> {
        let start = self.written;
        // Counted even without room, so the caller learns the buffer's necessary size.
        self.written = start.saturating_add(count);
        // With this cut, the compiler knows the slice's length where it knows `count`.
        let (places, _) = self.buffer.get_mut(start..)?.split_at_mut_checked(count)?;
        Some(places)
    }

    /// Writes the number of following elements or bytes. More than 2^32 - 1 fit into no buffer.
    pub(crate) fn count(&mut self, count: usize) {
        self.align(4);
        match u32::try_from(count) {
            Ok(count) => self.put(&count.to_le_bytes()),
            // A truncated count would be another value; `finish` reports a buffer that is too
            // small.
            Err(_) => self.written = usize::MAX,
        }
    }

    /// Returns how many bytes were written.
    ///
    /// # Errors
    ///
    /// [`Full`] if not everything fitted: then the buffer's contents are of no use.
    #[inline]
    pub const fn finish(self) -> Result<usize, Full> {
        match self.written <= self.buffer.len() {
            true => Ok(self.written),
            false => Err(Full {
                needed: self.written,
            }),
        }
    }
}

/// Refuses a type at compile time if it does not have the required form.
pub(crate) const fn require(has_form: bool) {
    assert!(
        has_form,
        "an option, a `char`, and a number of 16 bytes have no form in CDR"
    );
}

/// Returns the number of bytes up to the next multiple of `bytes`, or of 8 if `bytes` is more.
const fn padding(offset: usize, bytes: usize) -> usize {
    offset.wrapping_neg() & (bytes - 1) & 7
}

impl fmt::Display for Full {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the buffer is full; {} bytes would be needed",
            self.needed
        )
    }
}

impl core::error::Error for Full {}

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
pub struct Decoder<'b, const CDR: bool = false> {
    bytes: &'b [u8],
    offset: usize,
}

/// Bytes that are not a value of the type, or not a recording.
///
/// See [`Decoder`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Malformed {
    /// The offset of the first wrong byte.
    pub offset: usize,
    /// The part expected there.
    pub expected: &'static str,
}

impl<'b> Decoder<'b> {
    /// Begins at the start of these bytes.
    pub const fn new(bytes: &'b [u8]) -> Self {
        Self { bytes, offset: 0 }
    }
}

impl<'b> Decoder<'b, true> {
    /// Begins a value in the form of [CDR](crate#cdr).
    #[must_use]
    pub const fn cdr(bytes: &'b [u8]) -> Self {
        Self { bytes, offset: 0 }
    }
}

impl<'b, const CDR: bool> Decoder<'b, CDR> {
    /// Skips the padding before a number of so many bytes. Other programs leave arbitrary bytes of
    /// their memory there.
    #[inline]
    fn align(&mut self, bytes: usize) {
        if CDR {
            let end = self.offset + padding(self.offset, bytes);
            self.offset = end.min(self.bytes.len());
        }
    }

    /// Takes text without a copy.
    pub(crate) fn text(&mut self) -> Result<&'b str, Malformed> {
        let count = self.count(1)?;
        let malformed = self.expected("UTF-8 text");
        let bytes = self.take(count, malformed.expected)?;
        let bytes = match bytes {
            [text @ .., 0] if CDR => text,
            _ if CDR => return Err(self.expected("text with a zero at its end")),
            text => text,
        };
        core::str::from_utf8(bytes).map_err(|error| malformed.behind(error.valid_up_to()))
    }

    /// Returns the offset of the next byte.
    ///
    /// See [`Malformed`].
    pub const fn offset(&self) -> usize {
        self.offset
    }

    /// Returns how many bytes are left.
    ///
    /// ```
    /// assert_eq!(recording::Decoder::new(&[1, 2]).remaining(), 2);
    /// ```
    pub const fn remaining(&self) -> usize {
        self.bytes.len() - self.offset
    }

    /// Takes the next bytes as they are.
    ///
    /// # Errors
    ///
    /// There are fewer bytes; `expected` names the expected bytes.
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

    /// Takes the bytes of a number, or, in the form of recordings, of an array of numbers.
    pub(crate) fn array<const N: usize>(
        &mut self,
        expected: &'static str,
    ) -> Result<[u8; N], Malformed> {
        const { require(!CDR || N <= 8) }
        self.align(N);
        let offset = self.offset;
        let taken = self.take(N, expected)?;
        (taken.try_into()).map_err(|_| Malformed { offset, expected })
    }

    /// Takes the number of following elements, each of at least so many bytes. So the number never
    /// exceeds the bytes left.
    pub(crate) fn count(&mut self, least_bytes: usize) -> Result<usize, Malformed> {
        let expected = "how many elements follow, as many as there are bytes for";
        let offset = self.offset;
        // 4 bytes on every target, so another machine can read the recording.
        let count = u32::from_le_bytes(self.array(expected)?);
        let count = usize::try_from(count).unwrap_or(usize::MAX);
        // Checked before any allocation: an altered count must not cost more memory than the file
        // can fill.
        match count.checked_mul(least_bytes.max(1)) {
            Some(bytes) if bytes <= self.remaining() => Ok(count),
            _ => Err(Malformed { offset, expected }),
        }
    }

    /// Makes sure that nothing is left.
    ///
    /// # Errors
    ///
    /// Some bytes are left.
    ///
    /// ```
    /// let input = recording::Decoder::new(&[1]);
    /// assert_eq!(input.expect_end().unwrap_err().expected, "the end of the value");
    /// ```
    pub fn expect_end(&self) -> Result<(), Malformed> {
        match self.remaining() {
            0 => Ok(()),
            _ => Err(self.expected("the end of the value")),
        }
    }

    /// Returns an error naming the part expected at the next byte.
    pub(crate) const fn expected(&self, expected: &'static str) -> Malformed {
        Malformed {
            offset: self.offset,
            expected,
        }
    }
}

impl Malformed {
    /// Returns the same error for bytes that follow `bytes` others.
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
