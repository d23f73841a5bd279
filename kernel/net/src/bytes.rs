//! Numbers in the order of the network, and the check sum of RFC 1071.

use core::net::Ipv4Addr;

use crate::Mac;

/// Returns the `N` bytes at an offset, if there are so many.
pub(crate) fn array<const N: usize>(bytes: &[u8], at: usize) -> Option<[u8; N]> {
    bytes.get(at..)?.first_chunk().copied()
}

pub(crate) fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    array(bytes, at).map(u16::from_be_bytes)
}

pub(crate) fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    array(bytes, at).map(u32::from_be_bytes)
}

pub(crate) fn ip_at(bytes: &[u8], at: usize) -> Option<Ipv4Addr> {
    array::<4>(bytes, at).map(Ipv4Addr::from)
}

pub(crate) fn mac_at(bytes: &[u8], at: usize) -> Option<Mac> {
    array(bytes, at).map(Mac)
}

/// Writes bytes at an offset.
///
/// # Panics
///
/// Panics if they do not fit: a buffer has room for all headers.
pub(crate) fn put(bytes: &mut [u8], at: usize, what: &[u8]) {
    bytes[at..at + what.len()].copy_from_slice(what);
}

/// Adds bytes to a sum of 16-bit words. An odd last byte is the upper half of a word.
///
/// Words of 32 bits are added, as the sum of their halves has the same remainder.
pub(crate) fn sum(bytes: &[u8], before: u64) -> u64 {
    let (words, rest) = bytes.as_chunks::<4>();
    let whole = words
        .iter()
        .map(|word| u64::from(u32::from_be_bytes(*word)));
    let mut last = [0; 4];
    last[..rest.len()].copy_from_slice(rest);
    before + whole.sum::<u64>() + u64::from(u32::from_be_bytes(last))
}

/// Returns the check sum of what was added: 0 if it was added with its own right check sum.
pub(crate) fn check_sum(sum: u64) -> u16 {
    // Each step adds the upper half to the lower one; a sum of 64 bits is below 2^16 after four.
    let folded = (0..4).fold(sum, |sum, _| (sum & 0xffff) + (sum >> 16));
    let [.., high, low] = folded.to_be_bytes();
    !u16::from_be_bytes([high, low])
}
