//! The width: the largest number of subtasks that may run side by side.
//!
//! The width is the size of the largest antichain. By Dilworth's theorem (1950,
//! doi:10.2307/1969503) it equals the least number of chains that cover the
//! graph, which is `n` minus a maximum matching of the bipartite graph whose
//! edges are the pairs of the transitive closure (Fulkerson 1956). The matching
//! is found as by Hopcroft and Karp (SIAM J. Comput. 2(4), 1973,
//! doi:10.1137/0202019), with bit rows, so a phase takes `n * n / 64` word
//! operations and there are at most about `2 * sqrt(n)` phases.
//!
//! One job never runs on more than `width` cores at an instant; that is what
//! the workload bounds use it for. Subtasks with WCET 0 count.
//!
//! # The transitive closure, as one bit row a subtask
//!
//! Two subtasks are *parallel* if neither reaches the other; width and
//! intra-task priorities need that relation for all pairs. The closure takes
//! `n * n / 8` bytes and `edges * n / 64` word operations, so it is only built
//! up to [`SUBTASK_LIMIT`] subtasks (128 KiB); callers have a safe, coarser
//! answer beyond.

use alloc::vec;
use alloc::vec::Vec;

use super::task::Task;

/// Returns the width, or `None` for a DAG of more than
/// [`SUBTASK_LIMIT`] subtasks.
#[must_use]
pub fn width(task: &Task) -> Option<u64> {
    let closure = Closure::of(task)?;
    let mut matching = Matching::empty(task.subtask_count());
    while matching.layer(&closure) {
        for left in 0..task.subtask_count() {
            matching.augment(&closure, left);
        }
    }
    let free = matching.right_of.iter().filter(|mate| mate.is_none());
    u64::try_from(free.count()).ok()
}

/// Returns the most cores that one job can use at an instant, at least 1:
/// `min(cores, width)`, or just `cores` where the width is not known.
#[must_use]
pub fn parallelism(task: &Task, cores: u32) -> u64 {
    let cores = u64::from(cores);
    width(task).map_or(cores, |width| width.min(cores)).max(1)
}

/// A matching between the subtasks (left) and their copies (right).
struct Matching {
    right_of: Vec<Option<usize>>,
    left_of: Vec<Option<usize>>,
    /// The phase's layer of each left subtask, `usize::MAX` if not reached.
    layers: Vec<usize>,
    /// The right subtasks not yet visited in this phase's search.
    unvisited: Vec<u64>,
    /// Per layer the right subtasks that its left subtasks may go on to.
    reached_in: Vec<Vec<u64>>,
}

impl Matching {
    fn empty(count: usize) -> Self {
        Self {
            right_of: vec![None; count],
            left_of: vec![None; count],
            layers: vec![usize::MAX; count],
            unvisited: vec![0; words_for(count)],
            reached_in: Vec::new(),
        }
    }

    /// Layers the graph by distance from the free left subtasks (breadth
    /// first) and reports whether a free right subtask was reached.
    fn layer(&mut self, closure: &Closure) -> bool {
        let count = self.right_of.len();
        self.layers.fill(usize::MAX);
        self.reached_in.clear();
        for right in 0..count {
            insert(&mut self.unvisited, right);
        }
        let mut frontier: Vec<usize> = (0..count).filter(|&v| self.right_of[v].is_none()).collect();
        let mut found = false;
        while !frontier.is_empty() && !found {
            let depth = self.reached_in.len();
            let mut reached = vec![0; closure.words()];
            let mut following = Vec::new();
            for &left in &frontier {
                self.layers[left] = depth;
                while let Some(right) = first_common(closure.row(left), &self.unvisited) {
                    remove(&mut self.unvisited, right);
                    insert(&mut reached, right);
                    match self.left_of[right] {
                        Some(next) => following.push(next),
                        None => found = true,
                    }
                }
            }
            self.reached_in.push(reached);
            frontier = following;
        }
        found
    }

    /// Searches one augmenting path from a free left subtask along the layers
    /// (depth first, with an explicit stack) and applies it.
    fn augment(&mut self, closure: &Closure, root: usize) {
        if self.right_of[root].is_some() {
            return;
        }
        // Each entry: a left subtask and the right one through which its search goes on.
        let mut path: Vec<(usize, usize)> = Vec::new();
        let mut left = root;
        loop {
            let depth = path.len();
            let step = self
                .reached_in
                .get(depth)
                .and_then(|reached| first_common(closure.row(left), reached));
            match step {
                Some(right) => {
                    // Removed for good: a dead end stays one for this phase.
                    remove(&mut self.reached_in[depth], right);
                    match self.left_of[right] {
                        None => {
                            path.push((left, right));
                            for (one, other) in path {
                                self.right_of[one] = Some(other);
                                self.left_of[other] = Some(one);
                            }
                            return;
                        }
                        Some(next) if self.layers[next] == depth + 1 => {
                            path.push((left, right));
                            left = next;
                        }
                        Some(_) => {}
                    }
                }
                None => match path.pop() {
                    Some((previous, _)) => left = previous,
                    None => return,
                },
            }
        }
    }
}

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
const fn words_for(count: usize) -> usize {
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
fn first_common(one: &[u64], other: &[u64]) -> Option<usize> {
    one.iter()
        .zip(other)
        .enumerate()
        .find_map(|(word, (a, b))| {
            let common = a & b;
            (common != 0).then(|| word * 64 + common.trailing_zeros() as usize)
        })
}

#[cfg(test)]
mod tests {
    use super::{parallelism, width};
    use crate::analysis::{SUBTASK_LIMIT, Task};
    use common::random::Random;

    fn task(count: usize, edges: &[(usize, usize)]) -> Task {
        Task::new(1000, 1000, vec![1; count], edges).unwrap()
    }

    #[test]
    fn agrees_with_all_subsets_of_small_graphs() {
        let mut random = Random::new(1);
        for _ in 0..300 {
            let count = random.index(11);
            let edges: Vec<_> = random.edges(count, 25).collect();
            let mut reach = vec![vec![false; count]; count];
            for from in (0..count).rev() {
                for &(_, to) in edges.iter().filter(|edge| edge.0 == from) {
                    reach[from][to] = true;
                    let beyond = reach[to].clone();
                    for (here, there) in reach[from].iter_mut().zip(beyond) {
                        *here |= there;
                    }
                }
            }
            let antichain = |set: u32| {
                let members: Vec<usize> = (0..count).filter(|&v| set >> v & 1 == 1).collect();
                let ordered = |&a: &usize| members.iter().any(|&b| reach[a][b]);
                !members.iter().any(ordered)
            };
            let sets = (0_u32..1 << count).filter(|&set| antichain(set));
            let largest = sets.map(u32::count_ones).max().map(u64::from);
            assert_eq!(width(&task(count, &edges)), largest, "edges {edges:?}");
        }
    }

    #[test]
    fn beyond_the_limit_all_cores_count() {
        let chain: Vec<(usize, usize)> = (0..SUBTASK_LIMIT).map(|v| (v, v + 1)).collect();
        let long = task(SUBTASK_LIMIT + 1, &chain);
        assert_eq!(width(&long), None);
        assert_eq!(parallelism(&long, 8), 8);
        assert_eq!(parallelism(&task(3, &[(0, 1), (1, 2)]), 8), 1);
    }
}
