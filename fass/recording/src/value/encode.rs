//! Writing values into a buffer that is given.

use core::fmt;

/// Writes values one after the other into a buffer, and counts what does not fit.
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
pub struct Encoder<'b> {
    buffer: &'b mut [u8],
    /// The bytes so far, with those that did not fit; `usize::MAX`: more than can be.
    written: usize,
}

/// A buffer is too small for what was to be written.
///
/// See [`Encoder`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Full {
    /// The bytes that it would need.
    pub needed: usize,
}

impl<'b> Encoder<'b> {
    /// Begins at the start of a buffer.
    ///
    /// See [`Encoder`].
    #[inline]
    pub const fn new(buffer: &'b mut [u8]) -> Self {
        Self { buffer, written: 0 }
    }

    /// Writes bytes as they are.
    ///
    /// See [`Encoder`].
    #[inline]
    pub fn put(&mut self, bytes: &[u8]) {
        if let Some(places) = self.places(bytes.len()) {
            places.copy_from_slice(bytes);
        }
    }

    /// Returns the place of the next so many bytes, to be filled; none if they do not fit.
    #[inline]
    pub(crate) fn places(&mut self, count: usize) -> Option<&mut [u8]> {
        let start = self.written;
        self.written = start.saturating_add(count);
        // Cut in this way, the compiler knows its length where it knows `count`.
        let (places, _) = self.buffer.get_mut(start..)?.split_at_mut_checked(count)?;
        Some(places)
    }

    /// Writes how many elements or bytes follow. More than 2^32 - 1 fit into no buffer.
    pub(crate) fn count(&mut self, count: usize) {
        match u32::try_from(count) {
            Ok(count) => self.put(&count.to_le_bytes()),
            Err(_) => self.written = usize::MAX,
        }
    }

    /// Returns how many bytes were written.
    ///
    /// # Errors
    ///
    /// [`Full`] if not all fitted: then what is in the buffer is of no use.
    ///
    /// See [`Encoder`].
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
