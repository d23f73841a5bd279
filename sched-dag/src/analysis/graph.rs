//! Figures of one graph: bottom levels, longest path, path of most subtasks.
//!
//! Words: the *bottom level* (also *rank*) of a subtask is the largest sum of
//! WCETs along a path that begins with it, itself included. The largest bottom
//! level is the task's length.
//!
//! Ranks order subtasks: the descending rank is the list order of HLF, "highest
//! level first" (T. C. Hu, Operations Research 9(6), 1961).
//!
//! All functions are linear in subtasks and edges and walk the topological
//! order backwards instead of recursing. No sum can overflow: each is at most
//! the volume, or the sum of the weights.

use alloc::vec;
use alloc::vec::Vec;

use super::task::Task;

impl Task {
    /// Returns the bottom level of each subtask.
    #[must_use]
    pub fn bottom_levels(&self) -> Vec<u64> {
        self.levels(self.wcets_ns())
    }

    /// Returns for each subtask the largest sum of weights along a path that begins with it.
    fn levels(&self, weights: &[u64]) -> Vec<u64> {
        let mut levels = vec![0_u64; self.subtask_count()];
        for &subtask in self.topological_order().iter().rev() {
            let rest = self.successors(subtask).iter().map(|&next| levels[next]);
            levels[subtask] = weights[subtask] + rest.max().unwrap_or(0);
        }
        levels
    }

    /// Returns a longest path for the given weights; ties go to the smallest
    /// position for the first subtask and to the first edge for the others.
    ///
    /// The weights replace the WCETs and must sum to at most `u64::MAX`.
    ///
    /// # Panics
    ///
    /// If `weights` has fewer entries than there are subtasks.
    #[must_use]
    pub fn longest_path(&self, weights: &[u64]) -> Vec<usize> {
        let levels = self.levels(weights);
        let mut at = first_largest(0..levels.len(), &levels);
        let mut path = Vec::new();
        while let Some(subtask) = at {
            path.push(subtask);
            at = first_largest(self.successors(subtask).iter().copied(), &levels);
        }
        path
    }

    /// Tells for each subtask whether it has no predecessor.
    pub(super) fn sources(&self) -> Vec<bool> {
        let mut is_source = vec![true; self.subtask_count()];
        for subtask in 0..self.subtask_count() {
            for &next in self.successors(subtask) {
                is_source[next] = false;
            }
        }
        is_source
    }

    /// Returns the largest number of subtasks on one path.
    #[must_use]
    pub fn most_subtasks_on_a_path(&self) -> u64 {
        let counts = self.levels(&vec![1; self.subtask_count()]);
        counts.into_iter().max().unwrap_or(0)
    }

    /// Returns the largest WCET of a subtask, 0 if there is none.
    #[must_use]
    pub fn largest_wcet_ns(&self) -> u64 {
        self.wcets_ns().iter().copied().max().unwrap_or(0)
    }
}

/// Returns the first of the subtasks with the largest level.
fn first_largest(subtasks: impl Iterator<Item = usize>, levels: &[u64]) -> Option<usize> {
    subtasks.reduce(|first, next| {
        if levels[next] > levels[first] {
            next
        } else {
            first
        }
    })
}

#[cfg(test)]
mod tests {
    use super::super::task::Task;

    #[test]
    fn the_longest_path_follows_first_edges_on_ties() {
        let task = Task::new(9, 9, vec![1, 2, 2, 1], &[(0, 2), (0, 1), (1, 3), (2, 3)]).unwrap();
        assert_eq!(task.longest_path(task.wcets_ns()), [0, 2, 3]);
        assert_eq!(task.longest_path(&[0, 0, 0, 0]), [0, 2, 3]);
        assert_eq!(task.most_subtasks_on_a_path(), 3);
    }
}
