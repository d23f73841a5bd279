//! Real work for a processor: a product of matrices, a sort, bytes in memory.
//!
//! A simulated execution ([`fass::execute_for`]) halts its core or watches the clock. Computing
//! code does neither: it never waits, and keeps its processor until somebody takes the processor
//! away. [`compute`] is such work, in *rounds* all alike. The result depends on all of the work, so
//! a corrupted register or byte shows.

use core::hint::black_box;
/// The number of rows, and of columns, of a matrix.
const SIDE: usize = 8;

/// The number of sorted numbers.
const NUMBERS: usize = 64;

/// The number of moved bytes.
const BYTES: usize = 1024;

/// Does the given number of rounds of work. Equal arguments give equal results.
pub fn compute(rounds: u64, seed: u64) -> u64 {
    (0..rounds).fold(seed, |state, _| round(black_box(state)))
}

/// Does one round, some ten thousand instructions.
fn round(seed: u64) -> u64 {
    let mut random = seed | 1;
    let product = multiply(&mut random);
    let sorted = sort(&mut random);
    move_bytes(product ^ sorted.rotate_left(17))
}

/// Multiplies two matrices, and adds up the product's diagonal.
fn multiply(random: &mut u64) -> u64 {
    let mut draw = || core::array::from_fn(|_| f64::from(next(random) >> 16));
    let (left, right): ([[f64; SIDE]; SIDE], [[f64; SIDE]; SIDE]) = (
        core::array::from_fn(|_| draw()),
        core::array::from_fn(|_| draw()),
    );
    let (left, right) = (black_box(left), black_box(right));
    let mut product = [[0.0; SIDE]; SIDE];
    for (out, row) in product.iter_mut().zip(&left) {
        for (factor, others) in row.iter().zip(&right) {
            for (sum, other) in out.iter_mut().zip(others) {
                *sum += factor * other;
            }
        }
    }
    let product = black_box(product);
    let diagonal = product.iter().enumerate().map(|(place, row)| row[place]);
    diagonal.sum::<f64>().to_bits()
}

/// Sorts numbers, and mixes them in sorted order.
fn sort(random: &mut u64) -> u64 {
    let mut numbers: [u32; NUMBERS] = core::array::from_fn(|_| next(random));
    // By insertion: the library's sort would take 3 KB of the image.
    for end in 1..black_box(&mut numbers).len() {
        let (number, mut place) = (numbers[end], end);
        while place > 0 && numbers[place - 1] > number {
            numbers[place] = numbers[place - 1];
            place -= 1;
        }
        numbers[place] = number;
    }
    numbers.iter().fold(0, |mix: u64, number| {
        mix.rotate_left(7).wrapping_add(u64::from(*number))
    })
}

/// Writes bytes, moves some of them within their buffer, and hashes the buffer (FNV-1a).
fn move_bytes(seed: u64) -> u64 {
    let mut bytes = [0_u8; BYTES];
    for (word, place) in (0..).zip(bytes.chunks_exact_mut(8)) {
        place.copy_from_slice(&(seed.wrapping_add(word)).to_le_bytes());
    }
    black_box(&mut bytes).copy_within(3..BYTES / 2, BYTES / 4);
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash: u64, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// Returns the next number of a xorshift generator (Marsaglia, doi 10.18637/jss.v008.i14).
fn next(state: &mut u64) -> u32 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    #[allow(clippy::cast_possible_truncation, reason = "half of 64 bits is 32")]
    {
        (*state >> 32) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::compute;

    #[test]
    fn every_round_counts_and_nothing_else_does() {
        assert_eq!(compute(0, 7), 7);
        assert_eq!(compute(5, 7), compute(5, 7));
        assert_eq!(compute(3, compute(2, 7)), compute(5, 7));
        assert_ne!(compute(5, 7), compute(4, 7));
        assert_ne!(compute(5, 7), compute(5, 9));
    }
}
