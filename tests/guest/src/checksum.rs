//! Work with a known result: a different result shows a trace of an interruption.

use core::hint::black_box;

/// Sixteen independent sums keep all vector registers in use; the copies keep
/// string instructions, the direction flag and the red zone in use.
pub(crate) fn checksum() -> u64 {
    let mut sums = [0.0f64; 16];
    for step in 1..=black_box(50u32) {
        for (lane, sum) in (1u32..).zip(&mut sums) {
            *sum = (*sum + f64::from(step) / f64::from(lane)) * 0.999_9;
        }
    }
    let mut bytes = [0u8; 256];
    for (place, sum) in bytes.chunks_exact_mut(8).zip(sums.iter().cycle()) {
        place.copy_from_slice(&black_box(sum.to_bits()).to_le_bytes());
    }
    bytes.copy_within(black_box(3)..200, black_box(50));
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash: u64, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    })
}
