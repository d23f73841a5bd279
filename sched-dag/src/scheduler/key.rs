//! The key of an instance (R5).
//!
//! The key is absolute: fixed at readiness from data fixed at the job's release, and the same in
//! every comparison, whether the instances wait or run. No two keys are equal.
//!
//! R5 orders by (the policy's number, with the job's release if the policy adds it, DAG, job,
//! subtask). Here all parts form a single number, so that a single comparison suffices. Its low 32
//! bits are the vertex, which counts subtasks DAG by DAG; the higher bits depend on the
//! [`KeyOrder`]:
//!
//! | order | 127..96 | 95..64 | 63..32 |
//! |---|---|---|---|
//! | `Rank` | rank of (number, DAG, subtask) | 0 | 0 |
//! | `Job` | rank of (number, DAG) | sequence number | of the job |
//! | `Release` | release and | number | slot |
//! | `Sum` | release and | number | rank of (DAG, number) |
//!
//! Two jobs of one DAG have different releases, because the DAG has a period. A slot belongs to one
//! DAG, and slots are counted DAG by DAG. So, if all subtasks of each DAG have the same number,
//! (sum, slot, vertex) is the order of (sum, DAG, job, subtask). Otherwise instances of two jobs of
//! a DAG may have the same sum: that of the older job then has the larger number. So in that case
//! the larger number has the smaller rank.

use super::vertices::Vertex;

/// The composition of keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum KeyOrder {
    /// Each subtask has a rank of its own.
    Rank,
    /// Subtasks of one DAG may have the same rank; then the older job is first.
    Job,
    /// The smaller sum of release and number is first, and all subtasks of a DAG have the same
    /// number.
    Release,
    /// Likewise, with several numbers in a DAG.
    Sum,
}

/// An instance's place in the order of dispatch; the smaller key goes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct DispatchKey(u128);

impl DispatchKey {
    /// The mark for a missing key, larger than any key.
    pub(super) const NONE: Self = Self(u128::MAX);
    /// The mark for the key of the innermost begun entry on a core.
    pub(super) const ENTRY: Self = Self::of_rank(0, u32::MAX - 1);

    /// Makes the key of a vertex under the order `Rank`.
    #[inline]
    pub(super) const fn of_rank(rank: u32, vertex: u32) -> Self {
        Self::of_parts((rank as u64) << 32, 0, vertex)
    }

    /// Makes the key of a vertex under the order `Job`.
    pub(super) fn by_job(number: u32, vertex: &Vertex) -> Self {
        let [high, low] = halves(vertex.progress);
        Self::of_parts(u64::from(vertex.rank) << 32 | u64::from(high), low, number)
    }

    #[inline]
    pub(super) const fn of_parts(first: u64, second: u32, vertex: u32) -> Self {
        Self((first as u128) << 64 | (second as u128) << 32 | vertex as u128)
    }

    /// Reports whether this is the mark for a missing key.
    ///
    /// Looks at 32 bits only: a processor that has just stored a key in two halves waits until both
    /// have arrived before it can load them as a whole.
    #[inline]
    pub(super) const fn is_none(&self) -> bool {
        self.vertex() == u32::MAX
    }

    /// Returns the vertex of the instance.
    #[inline]
    pub(super) const fn vertex(self) -> u32 {
        low(self.0)
    }

    /// Returns the rank, under the order `Rank`.
    #[inline]
    pub(super) const fn rank(self) -> usize {
        low(self.0 >> 96) as usize
    }

    /// Returns the part above the vertex.
    #[inline]
    pub(super) const fn before_the_vertex(self) -> u128 {
        self.0 >> 32
    }

    /// Makes a key from the part above the vertex, and a vertex.
    #[inline]
    pub(super) const fn of_job(before: u128, vertex: u32) -> Self {
        Self(before << 32 | vertex as u128)
    }

    /// Returns the slot, under the order `Release`.
    #[inline]
    pub(super) const fn slot(self) -> usize {
        low(self.0 >> 32) as usize
    }
}

/// Returns the low 32 bits.
#[allow(clippy::cast_possible_truncation, reason = "that is its purpose")]
#[inline]
const fn low(number: u128) -> u32 {
    number as u32
}

/// Returns the high and the low half.
#[inline]
const fn halves(number: u64) -> [u32; 2] {
    [low((number >> 32) as u128), low(number as u128)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_compare_part_by_part() {
        let parts = [(0, 0, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0), (u64::MAX, 7, 3)];
        let keys =
            parts.map(|(first, second, vertex)| DispatchKey::of_parts(first, second, vertex));
        assert!(keys.is_sorted_by(|one, other| one < other));
        assert_eq!(keys[4].vertex(), 3);
        assert_eq!(keys[4].slot(), 7);
        assert_eq!(DispatchKey::of_job(keys[4].before_the_vertex(), 3), keys[4]);
        assert!(keys[4] < DispatchKey::NONE);
        assert_eq!(halves(0x1_0000_0002), [1, 2]);
    }
}
