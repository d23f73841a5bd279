//! The application's own file, as the firmware has loaded it, and the image in it.
//!
//! The layouts are those of Microsoft's PE format (of a PE32+ file, sections) and of ELF
//! (System V ABI; of a 64-bit file, program headers). Both files are made by the host tool,
//! and what they lack or have wrong is found without harm.

/// The section that has the image, as much of its ELF file as is loaded.
pub const IMAGE: &str = "image";
/// The section that has the image's command line.
pub const WORDS: &str = "words";
/// The section that has the file which the image is to find in memory.
pub const MODULE: &str = "module";

/// The section that has the [`sum`] of these three, little-endian.
pub const SUM: &str = "sum";

/// Returns the sum by which a file that was read wrongly is told from one that was read well:
/// FNV-1a in 64 bits, over the parts in their order.
#[must_use]
pub fn sum(parts: [&[u8]; 3]) -> u64 {
    let bytes = parts.into_iter().flatten();
    bytes.fold(0xcbf2_9ce4_8422_2325, |sum, byte| {
        (sum ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// Reports whether the sections that hold image, words and module are as they were made.
#[must_use]
pub fn is_whole(file: &[u8]) -> bool {
    let of = |name| section(file, name).unwrap_or_default();
    of(SUM) == sum([of(IMAGE), of(WORDS), of(MODULE)]).to_le_bytes()
}

/// Returns what a section has, of a PE file as it lies in memory.
#[must_use]
pub fn section<'f>(file: &'f [u8], name: &str) -> Option<&'f [u8]> {
    let headers = number(file, 0x3c, 4)?;
    let count = number(file, headers.checked_add(6)?, 2)?;
    let optional = number(file, headers.checked_add(20)?, 2)?;
    let table = headers.checked_add(24 + optional)?;
    (0..count).find_map(|index| {
        let entry = table.checked_add(40 * index)?;
        let own = bytes(file, entry, 8)?.iter();
        let padded = name.bytes().chain(core::iter::repeat(0));
        if !own.copied().eq(padded.take(8)) {
            return None;
        }
        let size = number(file, entry.checked_add(8)?, 4)?;
        bytes(file, number(file, entry.checked_add(12)?, 4)?, size)
    })
}

/// A part of an image, and where it belongs.
#[derive(Debug, PartialEq, Eq)]
pub struct Segment<'i> {
    /// The physical address of its first byte.
    pub start: u64,
    /// The physical address after its last byte.
    pub end: u64,
    /// Its first bytes; the rest is 0.
    pub bytes: &'i [u8],
}

/// Returns the parts of an image that are to be loaded.
pub fn segments(image: &[u8]) -> impl Iterator<Item = Segment<'_>> {
    const LOADED: u64 = 1;
    let table = number(image, 32, 8).unwrap_or(0);
    let count = number(image, 56, 2).unwrap_or(0);
    (0..count).filter_map(move |index| {
        let entry = table.checked_add(56 * index)?;
        let field = |offset| number(image, entry.checked_add(offset)?, 8);
        if number(image, entry, 4)? != LOADED {
            return None;
        }
        let start = field(24)?;
        Some(Segment {
            start,
            end: start.checked_add(field(40)?)?,
            bytes: bytes(image, field(8)?, field(32)?.min(field(40)?))?,
        })
    })
}

/// Returns the address at which an image is entered in 32-bit mode.
#[must_use]
pub fn entry(image: &[u8]) -> Option<u32> {
    u32::try_from(number(image, 24, 8)?).ok()
}

/// Returns a little-endian number of at most 8 bytes.
fn number(file: &[u8], at: u64, length: u64) -> Option<u64> {
    let bytes = bytes(file, at, length)?.iter().rev();
    Some(bytes.fold(0, |sum, byte| sum << 8 | u64::from(*byte)))
}

fn bytes(file: &[u8], at: u64, length: u64) -> Option<&[u8]> {
    let (start, end) = (at, at.checked_add(length)?);
    file.get(usize::try_from(start).ok()?..usize::try_from(end).ok()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An ELF file of one segment of 4 bytes that takes 6.
    fn image() -> Vec<u8> {
        let mut image = vec![0; 64 + 2 * 56];
        image[24..32].copy_from_slice(&0x20_0010_u64.to_le_bytes());
        image[32] = 64;
        image[56] = 2;
        image[64] = 4; // a note
        let segment = 64 + 56;
        image[segment] = 1;
        for (offset, value) in [(8, 176_u64), (24, 0x20_0000), (32, 4), (40, 6)] {
            image[segment + offset..segment + offset + 8].copy_from_slice(&value.to_le_bytes());
        }
        image.extend(b"code");
        image
    }

    #[test]
    fn an_image_says_what_is_loaded_where() {
        let image = image();
        let segment = Segment {
            start: 0x20_0000,
            end: 0x20_0006,
            bytes: b"code",
        };
        assert_eq!(segments(&image).collect::<Vec<_>>(), [segment]);
        assert_eq!(entry(&image), Some(0x20_0010));
    }

    #[test]
    fn what_is_cut_or_spoilt_does_no_harm() {
        let whole = image();
        for length in 0..whole.len() {
            assert_eq!(segments(&whole[..length]).count(), 0);
            assert_eq!(section(&whole[..length], WORDS), None);
        }
        for byte in 0..whole.len() {
            for value in [1, 0x7f, 0xff] {
                let mut spoilt = whole.clone();
                spoilt[byte] = value;
                assert!(segments(&spoilt).count() <= 2);
            }
        }
    }
}
