//! The result of a walk: the orientations after each sample.

use alloc::sync::Arc;
use core::sync::atomic::{AtomicU64, Ordering::Relaxed};

use maths::acos;

use crate::filter::Quaternion;

/// The numbers of a row: upper leg, lower leg, knee.
const OF_A_ROW: usize = 12;

/// The orientations after each sample. The DAG only writes them, so that they order nothing.
#[derive(Clone, Debug)]
pub struct Walk(Arc<[AtomicU64]>);

impl Walk {
    /// Makes room for the rows of so many samples.
    #[must_use]
    pub fn new(samples: usize) -> Self {
        Self((0..samples * OF_A_ROW).map(|_| AtomicU64::new(0)).collect())
    }

    /// Takes a row; one for which there is no room is left out.
    pub(crate) fn store(&self, row: usize, parts: [Quaternion; 3]) {
        let places = self.0.chunks_exact(OF_A_ROW).nth(row).unwrap_or_default();
        for (place, number) in places.iter().zip(parts.as_flattened()) {
            place.store(number.to_bits(), Relaxed);
        }
    }

    /// Returns the rows: upper leg, lower leg, knee, w, x, y and z of each.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = [f64; OF_A_ROW]> {
        (self.0.chunks_exact(OF_A_ROW))
            .map(|row| core::array::from_fn(|number| f64::from_bits(row[number].load(Relaxed))))
    }

    /// Returns the angles of the knee, in degrees.
    pub fn knee_degrees(&self) -> impl Iterator<Item = f64> {
        (self.rows()).map(|row| (2.0 * acos(row[8].abs().min(1.0))).to_degrees())
    }

    /// Returns a hash of all bits (FNV-1a with 64 bits, over whole words): two walks with the same
    /// one
    /// are the same.
    #[must_use]
    pub fn digest(&self) -> u64 {
        let words = self.0.iter().map(|word| word.load(Relaxed));
        words.fold(0xcbf2_9ce4_8422_2325, |hash, word| {
            (hash ^ word).wrapping_mul(0x0000_0100_0000_01b3)
        })
    }
}
