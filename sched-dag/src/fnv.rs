//! The hash of G. Fowler, L. C. Noll and P. Vo, in its form 1a with 64 bits.

/// The hash of an empty input.
pub(crate) const EMPTY: u64 = 0xcbf2_9ce4_8422_2325;

/// Returns the hash of an input extended by bytes, from its hash.
pub(crate) fn fnv_1a(hash: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(hash, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}
