//! Zenoh's bytes: numbers of variable length, bytes preceded by their count, and extensions.
//!
//! Each byte of a number has seven bits of the number, and a bit that says whether another byte
//! follows. The ninth byte has eight bits, and is always the last: so nine bytes hold 64 bits, as
//! time stamps of 2038 and later need.

/// Why a datagram is not read to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    /// The datagram breaks the protocol's rules, or ends too early.
    Malformed,
    /// The datagram has an unknown part, so the rest cannot be interpreted, or has more messages or
    /// extensions than are read.
    Foreign,
    /// The datagram comes twice, or too late.
    Repeated,
}

/// The most messages, and the most extensions, read from a datagram, to bound the time for each.
const MOST_MESSAGES: u32 = 16;
const MOST_EXTENSIONS: u32 = 32;

/// Bytes to be read, and the most messages and extensions that may follow.
pub(crate) struct Reader<'b>(&'b [u8], u32, u32);

impl<'b> Reader<'b> {
    pub(crate) const fn new(bytes: &'b [u8]) -> Self {
        Self(bytes, MOST_MESSAGES, MOST_EXTENSIONS)
    }

    /// Reads one message at most, for fragments.
    pub(crate) const fn of_one(bytes: &'b [u8]) -> Self {
        Self(bytes, 1, MOST_EXTENSIONS)
    }

    /// Returns the bytes not read yet.
    pub(crate) const fn rest(&self) -> &'b [u8] {
        self.0
    }

    /// Reads the header of one more message.
    pub(crate) fn header(&mut self) -> Result<u8, Fault> {
        self.1 = self.1.checked_sub(1).ok_or(Fault::Foreign)?;
        self.byte()
    }

    /// Reads all remaining bytes.
    pub(crate) fn take_rest(&mut self) -> &'b [u8] {
        core::mem::take(&mut self.0)
    }

    pub(crate) fn byte(&mut self) -> Result<u8, Fault> {
        let (first, rest) = self.0.split_first().ok_or(Fault::Malformed)?;
        self.0 = rest;
        Ok(*first)
    }

    pub(crate) fn number(&mut self) -> Result<u64, Fault> {
        let mut value = 0;
        for shift in (0..56).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Ok(value | u64::from(self.byte()?) << 56)
    }

    pub(crate) fn bytes(&mut self, length: u64) -> Result<&'b [u8], Fault> {
        let split = usize::try_from(length).ok();
        let split = split.and_then(|length| self.0.split_at_checked(length));
        let (bytes, rest) = split.ok_or(Fault::Malformed)?;
        self.0 = rest;
        Ok(bytes)
    }

    pub(crate) fn counted(&mut self) -> Result<&'b [u8], Fault> {
        let length = self.number()?;
        self.bytes(length)
    }

    /// Reads the extensions behind a message with this header, if any. Hands over each extension,
    /// with its bytes if it has any. `known` must have the bit of each extension that must be
    /// understood.
    pub(crate) fn extensions(
        &mut self,
        header: u8,
        known: u16,
        each: &mut dyn FnMut(u8, &'b [u8]),
    ) -> Result<(), Fault> {
        let mut has_more = header & 0x80 != 0;
        while has_more {
            self.2 = self.2.checked_sub(1).ok_or(Fault::Foreign)?;
            let header = self.byte()?;
            let (is_mandatory, id) = (header & 0x10 != 0, header & 15);
            let body = match header >> 5 & 3 {
                0 => &[],
                1 => self.number().map(|_| &[][..])?,
                2 => self.counted()?,
                _ => return Err(Fault::Malformed),
            };
            if is_mandatory && known >> id & 1 == 0 {
                return Err(Fault::Foreign);
            }
            each(id, body);
            has_more = header & 0x80 != 0;
        }
        Ok(())
    }
}

/// Room for bytes, and the number written. If some bytes do not fit, neither they nor any later
/// bytes are written.
pub(crate) struct Writer<'b>(&'b mut [u8], Option<usize>);

impl<'b> Writer<'b> {
    pub(crate) const fn new(out: &'b mut [u8]) -> Self {
        Self(out, Some(0))
    }

    pub(crate) fn bytes(&mut self, bytes: &[u8]) {
        self.1 = self.1.and_then(|from| {
            let to = from + bytes.len();
            self.0.get_mut(from..to)?.copy_from_slice(bytes);
            Some(to)
        });
    }

    pub(crate) fn number(&mut self, mut value: u64) {
        let mut left = 8;
        while value > 0x7f && left > 0 {
            self.bytes(&[value.to_le_bytes()[0] | 0x80]);
            value >>= 7;
            left -= 1;
        }
        self.bytes(&[value.to_le_bytes()[0]]);
    }

    pub(crate) fn counted(&mut self, bytes: &[u8]) {
        self.number(bytes.len() as u64);
        self.bytes(bytes);
    }

    /// Returns how many bytes were written; `None` if some had no room.
    pub(crate) const fn end(self) -> Option<usize> {
        self.1
    }
}

#[cfg(test)]
mod tests {
    use super::{Reader, Writer};

    #[test]
    fn a_number_of_64_bits_has_nine_bytes_at_most() {
        let lengths = [
            (0, 1),
            (127, 1),
            (128, 2),
            ((1 << 28) - 1, 4),
            ((1 << 56) - 1, 8),
        ];
        for (number, length) in
            lengths
                .into_iter()
                .chain([(1 << 56, 9), (1 << 63, 9), (u64::MAX, 9)])
        {
            let mut bytes = [0xaa; 12];
            let mut writer = Writer::new(&mut bytes);
            writer.number(number);
            assert_eq!(writer.end(), Some(length), "{number:#x}");
            let mut reader = Reader::new(&bytes);
            assert_eq!(reader.number(), Ok(number));
            assert_eq!(reader.rest().len(), 12 - length);
            // None of its beginnings is a number.
            assert!(Reader::new(&bytes[..length - 1]).number().is_err());
        }
    }
}
