//! Sums of workloads as functions, of the window or of the deadline: the pieces in a row.

use alloc::vec;
use alloc::vec::Vec;

use crate::analysis::workload::Piece;

/// The most pieces of one DAG's curve.
const MOST_PIECES: usize = 512;

/// A function that never falls, from 0 on.
pub(super) struct Curve {
    /// The first one begins at 0, the last one has no end.
    pieces: Vec<Part>,
}

#[derive(Clone, Copy)]
struct Part {
    start: u64,
    value: u128,
    slope: u128,
}

impl Curve {
    /// Returns a curve that is 0 throughout.
    pub(super) fn none() -> Self {
        let (start, value, slope) = (0, 0, 0);
        Self {
            pieces: vec![Part {
                start,
                value,
                slope,
            }],
        }
    }

    /// Takes the pieces of a function up to a limit, unless they are too many.
    pub(super) fn of(until: u64, at: impl Fn(u64) -> Piece) -> Option<Self> {
        let mut pieces = Vec::new();
        let mut start = 0;
        while pieces.len() < MOST_PIECES {
            let Piece { value, slope, span } = at(start);
            pieces.push(Part {
                start,
                value,
                slope,
            });
            let span = span.and_then(|span| u64::try_from(span).ok());
            match span.and_then(|span| start.checked_add(span)) {
                Some(end) if end <= until => start = end,
                _ => return Some(Self { pieces }),
            }
        }
        None
    }

    /// Returns the sum of two curves.
    pub(super) fn and(&self, other: &Self) -> Self {
        let (one, two) = (&self.pieces, &other.pieces);
        let mut pieces = Vec::with_capacity(one.len() + two.len());
        let (mut first, mut second) = (0, 0);
        loop {
            let start = one[first].start.max(two[second].start);
            pieces.push(Part {
                start,
                value: one[first].value_at(start) + two[second].value_at(start),
                slope: one[first].slope + two[second].slope,
            });
            let next =
                |pieces: &[Part], index: usize| pieces.get(index + 1).map(|piece| piece.start);
            let (ahead, beside) = (next(one, first), next(two, second));
            let Some(end) = ahead.into_iter().chain(beside).min() else {
                return Self { pieces };
            };
            first += usize::from(ahead == Some(end));
            second += usize::from(beside == Some(end));
        }
    }

    /// Returns the value at a place, and how it goes on.
    pub(super) fn at(&self, place: u64) -> Piece {
        let after = (self.pieces).partition_point(|piece| piece.start <= place);
        let piece = self.pieces[after - 1];
        let end = self.pieces.get(after).map(|next| next.start);
        Piece {
            value: piece.value_at(place),
            slope: piece.slope,
            span: end.map(|end| u128::from(end - place)),
        }
    }
}

impl Part {
    fn value_at(&self, place: u64) -> u128 {
        self.value + self.slope * u128::from(place - self.start)
    }
}
