//! Numbers in network byte order, and the check sum of RFC 1071.

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
/// Panics if the bytes do not fit: a buffer has room for all headers.
pub(crate) fn put(bytes: &mut [u8], at: usize, what: &[u8]) {
    bytes[at..at + what.len()].copy_from_slice(what);
}

/// Adds bytes to a sum of 16-bit words. An odd last byte is the upper half of a word.
///
/// Words of 64 bits are added in this machine's byte order: their sum has the same remainder as the
/// sum of their quarters, except for the order of two bytes.
pub(crate) fn sum(bytes: &[u8], before: u64) -> u64 {
    let word = |word: &[u8; 8]| u128::from(u64::from_le_bytes(*word));
    let (words, rest) = bytes.as_chunks::<8>();
    let (blocks, words) = words.as_chunks::<4>();
    let mut last = [0; 8];
    last[..rest.len()].copy_from_slice(rest);
    let mut whole = words.iter().map(word).sum::<u128>() + word(&last);
    for [a, b, c, d] in blocks {
        whole += word(a) + word(b) + word(c) + word(d);
    }
    before + u64::from(folded(whole).swap_bytes())
}

/// Returns the check sum of the added bytes: 0 if they include their own right check sum.
pub(crate) fn check_sum(sum: u64) -> u16 {
    !folded(sum.into())
}

/// Adds a number's words of 16 bits, repeatedly, until a single word is left.
fn folded(sum: u128) -> u16 {
    let half = |sum: u128, bits: u32| (sum & ((1 << bits) - 1)) + (sum >> bits);
    // The halves of 65 bits have 33, and so on.
    let sum = [64, 32, 16, 16, 16].into_iter().fold(sum, half);
    let [low, high, ..] = sum.to_le_bytes();
    u16::from_le_bytes([low, high])
}
