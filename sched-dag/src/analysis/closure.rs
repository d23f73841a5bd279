//! The transitive closure of a graph, as one bit row a subtask.
//!
//! Two subtasks are *parallel* if neither reaches the other; width and
//! intra-task priorities need that relation for all pairs. The closure takes
//! `n * n / 8` bytes and `edges * n / 64` word operations, so it is only built
//! up to [`SUBTASK_LIMIT`] subtasks (128 KiB); callers have a safe, coarser
//! answer beyond.

use alloc::vec;
use alloc::vec::Vec;

use super::task::Task;

/// The most subtasks of a DAG for which the closure is built: 1,024.
///
/// Beyond, the width counts as unlimited (`p = m`, which is safe) and
/// intra-task priorities are not exploited. The limit keeps a commit's time
/// near linear and its temporary memory small.
pub const SUBTASK_LIMIT: usize = 1024;

/// For each subtask the set of subtasks that it precedes, directly or not.
pub(super) struct Closure {
    words: usize,
    rows: Vec<u64>,
}

impl Closure {
    /// Builds the closure, or returns `None` beyond [`SUBTASK_LIMIT`].
    pub(super) fn of(task: &Task) -> Option<Self> {
        let count = task.subtask_count();
        if count > SUBTASK_LIMIT {
            return None;
        }
        let words = words_for(count);
        let mut rows = vec![0; words * count];
        for subtask in task.topological_order().rev() {
            for successor in task.successors(subtask) {
                for word in 0..words {
                    rows[subtask * words + word] |= rows[successor * words + word];
                }
                insert(&mut rows[subtask * words..], successor);
            }
        }
        Some(Self { words, rows })
    }

    /// Returns the words of a row.
    pub(super) const fn words(&self) -> usize {
        self.words
    }

    /// Returns the set of subtasks after `subtask`.
    pub(super) fn row(&self, subtask: usize) -> &[u64] {
        &self.rows[subtask * self.words..(subtask + 1) * self.words]
    }

    /// Reports whether `first` precedes `second`.
    pub(super) fn precedes(&self, first: usize, second: usize) -> bool {
        contains(self.row(first), second)
    }
}

/// Returns the number of 64-bit words that hold `count` bits.
pub(super) const fn words_for(count: usize) -> usize {
    count.div_ceil(64)
}

/// Adds an element to a bit set.
pub(super) fn insert(set: &mut [u64], element: usize) {
    set[element / 64] |= 1 << (element % 64);
}

/// Removes an element from a bit set.
pub(super) fn remove(set: &mut [u64], element: usize) {
    set[element / 64] &= !(1 << (element % 64));
}

/// Reports whether a bit set has an element.
pub(super) fn contains(set: &[u64], element: usize) -> bool {
    set[element / 64] >> (element % 64) & 1 == 1
}

/// Returns the smallest element that is in both sets.
pub(super) fn first_common(one: &[u64], other: &[u64]) -> Option<usize> {
    one.iter()
        .zip(other)
        .enumerate()
        .find_map(|(word, (a, b))| {
            let common = a & b;
            (common != 0).then(|| word * 64 + common.trailing_zeros() as usize)
        })
}
