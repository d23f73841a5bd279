//! The DAGs that may outrank one, as its equations ask about them: one by one, or as sums.
//!
//! Sums (see `sums`) are for speed alone: with and without them the bounds are the same. They
//! are reached through traits, so that an image has their code only if it asks for them.

use alloc::vec::Vec;

use super::interference::{Clip, Other};
use super::workload::Piece;

/// The workloads of DAGs that may outrank the one under analysis; a list asks one by one.
pub(super) trait Above {
    /// Reports whether there are none.
    fn is_empty(&self) -> bool;

    /// Returns a time for which the job waits in every solution.
    fn least_waiting_ns(&self, _cores: usize) -> u64 {
        0
    }

    /// Reports whether there are sums.
    fn has_sums(&self) -> bool {
        false
    }

    /// Adds what may execute on `m - j` cores, as [`Other::add_to`] does. By sums it is exact
    /// for j = 0, and beyond a lower bound.
    fn add_to(
        &self,
        times: (u64, u64),
        clip: Clip,
        cores: usize,
        by_sums: bool,
        sums: [&mut [Piece]; 2],
    );

    /// Returns what may execute on all cores within a window.
    fn on_all_cores(&self, window_ns: u64) -> Piece;
}

impl Above for Vec<Other> {
    fn is_empty(&self) -> bool {
        self.is_empty()
    }

    fn add_to(
        &self,
        times: (u64, u64),
        clip: Clip,
        cores: usize,
        _: bool,
        [plain, clipped]: [&mut [Piece]; 2],
    ) {
        for other in self {
            other.add_to(times, clip, cores, plain, clipped);
        }
    }

    fn on_all_cores(&self, window_ns: u64) -> Piece {
        let pieces = self.iter();
        let pieces = pieces.map(|other| other.on_all_cores().at(window_ns));
        pieces.fold(Piece::NONE, Piece::and)
    }
}
