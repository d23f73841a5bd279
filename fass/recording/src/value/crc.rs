//! The checksum of files: CRC-32 with the polynomial of IEEE 802.3, as gzip and MCAP use it.

/// The polynomial, its lowest power first.
const POLYNOMIAL: u32 = 0xedb8_8320;

/// What eight zero bits do to each value of the lowest byte.
static TABLE: [u32; 256] = table();

const fn table() -> [u32; 256] {
    let mut table = [0_u32; 256];
    let mut byte = 0_u32;
    while byte < 256 {
        let mut value = byte;
        let mut bit = 0;
        while bit < 8 {
            value = if value & 1 == 1 {
                value >> 1 ^ POLYNOMIAL
            } else {
                value >> 1
            };
            bit += 1;
        }
        table[byte as usize] = value;
        byte += 1;
    }
    table
}

/// A checksum of bytes that are given piece by piece.
///
/// ```
/// use recording::Crc;
///
/// let mut crc = Crc::new();
/// crc.update(b"1234");
/// crc.update(b"56789");
/// assert_eq!(crc.value(), 0xcbf4_3926);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crc(u32);

impl Crc {
    /// Begins with no byte.
    ///
    /// See [`Crc`].
    #[must_use]
    pub const fn new() -> Self {
        Self(u32::MAX)
    }

    /// Takes more bytes in.
    ///
    /// See [`Crc`].
    pub fn update(&mut self, bytes: &[u8]) {
        self.0 = bytes.iter().fold(self.0, |crc, &byte| {
            let [low, ..] = crc.to_le_bytes();
            TABLE[usize::from(low ^ byte)] ^ crc >> 8
        });
    }

    /// Returns the checksum of all bytes so far.
    ///
    /// See [`Crc`].
    #[must_use]
    pub const fn value(self) -> u32 {
        !self.0
    }
}

impl Default for Crc {
    fn default() -> Self {
        Self::new()
    }
}
