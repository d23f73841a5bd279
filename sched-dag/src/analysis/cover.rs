//! The most work a few disjoint chains of a graph can hold.
//!
//! Words: a *chain* is a set of subtasks any two of which are ordered. Along a path of the graph a
//! chain *takes* some subtasks and *passes* the others. The *cover* of `k` chains is the largest
//! sum of WCETs taken together by `k` disjoint chains. For one chain the cover is the length; for
//! as many chains as the graph is wide, the volume.
//!
//! Up to [`STEPS`] the covers are exact. Chains that may pass through subtasks are the paths of a
//! flow in which each subtask pays its WCET once. A heaviest augmenting path makes the flow larger
//! by one chain (R. K. Ahuja, T. L. Magnanti, J. B. Orlin, "Network Flows", 1993, section 9.7).
//! Sweeps along the topological order and back, until nothing changes, find the weights; a few
//! sweeps are enough. Beyond [`STEPS`], chains are peeled off one by one, a longest path at a time.
//! The resulting covers are too small, and therefore safe wherever a cover is subtracted.

use alloc::vec;
use alloc::vec::Vec;

use super::task::Task;

/// The limit on subtasks and edges visited, summed over the chains, for exact covers, and for
/// peeled chains beyond the second.
pub(super) const STEPS: usize = 1 << 17;

/// One chain: the subtasks of a path, each with whether the chain takes it.
pub(super) type CoverChain = Vec<(usize, bool)>;

/// Returns the covers of 1, 2, .. chains: at most `most` chains, and no more than needed to cover
/// the volume.
///
/// Exact unless the graph is large.
pub fn covers(task: &Task, most: usize) -> Vec<u64> {
    exact(task, most).unwrap_or_else(|| sums(&parts(task, most)))
}

/// Returns the most cores one job can use at an instant, at least 1; the covers for as many chains;
/// and the work of each chain found by [`peel`].
pub(super) fn parallelism_covers_and_parts(task: &Task, cores: u32) -> (u64, Vec<u64>, Vec<u64>) {
    let most = usize::try_from(cores).unwrap_or(usize::MAX);
    let covers = exact(task, most);
    let parallelism = covers.as_ref().map_or(most, Vec::len).max(1);
    let parts = parts(task, parallelism);
    let covers = covers.unwrap_or_else(|| sums(&parts));
    (parallelism as u64, covers, parts)
}

/// Returns the width, or `None` if the graph is too large to find it.
pub fn width(task: &Task) -> Option<u64> {
    Some(exact(task, usize::MAX)?.len() as u64)
}

/// Returns the most cores one job can use at an instant, at least 1: `min(cores, width)`, or just
/// `cores` if the width is unknown.
pub fn parallelism(task: &Task, cores: u32) -> u64 {
    parallelism_covers_and_parts(task, cores).0
}

/// Returns the covers, if they can be found within the limit.
fn exact(task: &Task, most: usize) -> Option<Vec<u64>> {
    let mut flow = ChainFlow::none(task);
    let mut covers: Vec<u64> = Vec::new();
    let mut sum = 0;
    while covers.len() < most && sum < task.volume_ns() {
        if !is_small(task, covers.len() + 1) {
            return None;
        }
        sum += flow.augment();
        covers.push(sum);
    }
    Some(covers)
}

fn parts(task: &Task, most: usize) -> Vec<u64> {
    let chains = peel(task, most);
    chains.iter().map(|chain| weight(task, chain)).collect()
}

fn sums(parts: &[u64]) -> Vec<u64> {
    let sums = parts.iter().scan(0, |sum, part| {
        *sum += part;
        Some(*sum)
    });
    sums.collect()
}

/// Returns the chains behind the `count`-th of the covers of at most `most` chains.
pub(super) fn covering(task: &Task, most: usize, count: usize) -> Vec<CoverChain> {
    if is_small(task, most.min(task.subtask_count())) {
        heaviest(task, count)
    } else {
        peel(task, count)
    }
}

/// Returns `count` disjoint chains with the most work, whatever the size of the graph.
pub(super) fn heaviest(task: &Task, count: usize) -> Vec<CoverChain> {
    let mut flow = ChainFlow::none(task);
    for _ in 0..count {
        flow.augment();
    }
    flow.into_chains()
}

/// Returns disjoint chains, each a longest path in the rest left by earlier chains: at most `most`
/// chains, and fewer in a large graph.
pub(super) fn peel(task: &Task, most: usize) -> Vec<CoverChain> {
    let steps = (task.subtask_count() + task.edge_count()).max(1);
    let mut weights = Vec::from(task.wcets_ns());
    let mut left = task.volume_ns();
    let mut chains = Vec::new();
    while left > 0 && chains.len() < most.min((STEPS / steps).max(2)) {
        let path = task.longest_path(&weights).into_iter();
        let chain: CoverChain = path
            .map(|subtask| (subtask, core::mem::take(&mut weights[subtask]) > 0))
            .collect();
        left -= weight(task, &chain);
        chains.push(chain);
    }
    chains
}

/// Returns the work taken by a chain.
pub(super) fn weight(task: &Task, chain: &CoverChain) -> u64 {
    let taken = chain.iter().filter(|(_, takes)| *takes);
    taken.map(|&(subtask, _)| task.wcets_ns()[subtask]).sum()
}

fn is_small(task: &Task, chains: usize) -> bool {
    let steps = task.subtask_count() + task.edge_count();
    steps.saturating_mul(chains) <= STEPS
}

/// A flow of chains. Each subtask has an entry and an exit. Between them the subtask is taken once,
/// for its WCET, or passed any number of times, for nothing.
struct ChainFlow<'a> {
    task: &'a Task,
    taken: Vec<bool>,
    passed: Vec<u32>,
    /// The number of chains along each edge, in the order of the task's successors.
    along: Vec<u32>,
}

/// The last step of the heaviest way to an entry or exit.
#[derive(Clone, Copy)]
enum PathStep {
    /// The way begins at this entry.
    Begin,
    /// Along an edge, from the exit of the predecessor.
    Edge { from: usize, edge: usize },
    /// From the entry of the same subtask: taking or passing the subtask.
    Through { takes: bool },
    /// From the exit of the same subtask, undoing a taking or a passing.
    Undo { takes: bool },
    /// Against an edge, from the entry of the successor.
    UndoEdge { to: usize, edge: usize },
}

/// The heaviest ways to an entry, or to an exit, of each subtask.
struct HeaviestPaths {
    weights: Vec<u64>,
    steps: Vec<PathStep>,
}

impl HeaviestPaths {
    fn improve(&mut self, subtask: usize, weight: u64, step: PathStep) -> bool {
        let is_heavier = weight > self.weights[subtask];
        if is_heavier {
            self.weights[subtask] = weight;
            self.steps[subtask] = step;
        }
        is_heavier
    }
}

impl<'a> ChainFlow<'a> {
    fn none(task: &'a Task) -> Self {
        Self {
            task,
            taken: vec![false; task.subtask_count()],
            passed: vec![0; task.subtask_count()],
            along: vec![0; task.edge_count()],
        }
    }

    /// Adds a chain so that all chains together take the most work, and returns the increase.
    fn augment(&mut self) -> u64 {
        let count = self.task.subtask_count();
        let ways = |step| HeaviestPaths {
            weights: vec![0; count],
            steps: vec![step; count],
        };
        let (mut entries, mut exits) = (
            ways(PathStep::Begin),
            ways(PathStep::Through { takes: false }),
        );
        // No way goes round in circles, so each pair of sweeps settles a further turn of some way.
        for _ in 0..=count {
            self.sweep(&mut entries, &mut exits);
            if !self.sweep_back(&mut entries, &mut exits) {
                break;
            }
        }
        let last = (0..count).max_by_key(|&v| (exits.weights[v], core::cmp::Reverse(v)));
        let Some(last) = last.filter(|&v| exits.weights[v] > 0) else {
            return 0;
        };
        self.follow(last, &entries, &exits);
        exits.weights[last]
    }

    fn sweep(&self, entries: &mut HeaviestPaths, exits: &mut HeaviestPaths) {
        for v in self.task.topological_order() {
            let here = entries.weights[v];
            if !self.taken[v] {
                let weight = here + self.task.wcets_ns()[v];
                exits.improve(v, weight, PathStep::Through { takes: true });
            }
            exits.improve(v, here, PathStep::Through { takes: false });
            for (edge, to) in self.task.edges_of(v) {
                let step = PathStep::Edge { from: v, edge };
                entries.improve(to, exits.weights[v], step);
            }
        }
    }

    fn sweep_back(&self, entries: &mut HeaviestPaths, exits: &mut HeaviestPaths) -> bool {
        let mut changed = false;
        for v in self.task.topological_order().rev() {
            for (edge, to) in self.task.edges_of(v) {
                if self.along[edge] > 0 {
                    let step = PathStep::UndoEdge { to, edge };
                    changed |= exits.improve(v, entries.weights[to], step);
                }
            }
            if self.taken[v]
                && let Some(weight) = exits.weights[v].checked_sub(self.task.wcets_ns()[v])
            {
                changed |= entries.improve(v, weight, PathStep::Undo { takes: true });
            }
            if self.passed[v] > 0 {
                changed |= entries.improve(v, exits.weights[v], PathStep::Undo { takes: false });
            }
        }
        changed
    }

    /// Adds the heaviest way to the exit of `last` to the flow.
    fn follow(&mut self, last: usize, entries: &HeaviestPaths, exits: &HeaviestPaths) {
        let (mut at, mut is_exit) = (last, true);
        loop {
            let steps = if is_exit {
                &exits.steps
            } else {
                &entries.steps
            };
            match steps[at] {
                PathStep::Begin => return,
                PathStep::Edge { from, edge } => {
                    self.along[edge] += 1;
                    at = from;
                }
                PathStep::UndoEdge { to, edge } => {
                    self.along[edge] -= 1;
                    at = to;
                }
                PathStep::Through { takes: true } => self.taken[at] = true,
                PathStep::Through { takes: false } => self.passed[at] += 1,
                PathStep::Undo { takes: true } => self.taken[at] = false,
                PathStep::Undo { takes: false } => self.passed[at] -= 1,
            }
            is_exit = !is_exit;
        }
    }

    /// Takes the flow apart into its chains.
    fn into_chains(mut self) -> Vec<CoverChain> {
        // As many chains begin at a subtask as lead through it without arriving along an edge.
        let through = self.taken.iter().zip(&self.passed);
        let mut begin: Vec<u32> = through.map(|(&t, &p)| u32::from(t) + p).collect();
        for v in 0..begin.len() {
            for (edge, to) in self.task.edges_of(v) {
                begin[to] -= self.along[edge];
            }
        }
        let mut chains = Vec::new();
        for (first, &count) in begin.iter().enumerate() {
            for _ in 0..count {
                let mut chain = CoverChain::new();
                let mut at = Some(first);
                while let Some(v) = at {
                    // A subtask is covered by one chain; further chains only pass through.
                    chain.push((v, core::mem::take(&mut self.taken[v])));
                    let next = self
                        .task
                        .edges_of(v)
                        .find(|&(edge, _)| self.along[edge] > 0);
                    at = next.map(|(edge, to)| {
                        self.along[edge] -= 1;
                        to
                    });
                }
                chains.push(chain);
            }
        }
        chains
    }
}

#[cfg(test)]
mod tests {
    use super::{covering, covers, parallelism, weight, width};
    use crate::analysis::Task;
    use random::Random;

    #[test]
    fn chains_are_disjoint_paths_that_hold_the_cover() {
        // A grid of 6 rows and 5 columns, with weights that differ.
        let at = |row: usize, column: usize| 5 * row + column;
        let right = (0..6).flat_map(|r| (0..4).map(move |c| (at(r, c), at(r, c + 1))));
        let down = (0..5).flat_map(|r| (0..5).map(move |c| (at(r, c), at(r + 1, c))));
        let edges: Vec<(usize, usize)> = right.chain(down).collect();
        let wcets = (0..30).map(|v| 1 + v * 7 % 13).collect();
        let task = Task::new(999, 999, wcets, &edges).unwrap();
        let covers = covers(&task, 30);
        assert_eq!((covers.len(), covers[4]), (5, task.volume_ns()));
        for (count, &cover) in (1..).zip(&covers) {
            let chains = covering(&task, 30, count);
            assert_eq!(chains.len(), count);
            let mut taken = [0; 30];
            for chain in &chains {
                let pairs = chain.windows(2);
                let mut pairs = pairs.map(|pair| (pair[0].0, pair[1].0));
                assert!(pairs.all(|pair| edges.contains(&pair)), "{chain:?}");
                for &(v, takes) in chain {
                    taken[v] += u32::from(takes);
                }
            }
            assert!(taken.iter().all(|&times| times <= 1), "{chains:?}");
            let sum: u64 = chains.iter().map(|chain| weight(&task, chain)).sum();
            assert_eq!(sum, cover);
        }
    }

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
        let wide = task(1000, &[]);
        assert_eq!((width(&wide), parallelism(&wide, 200)), (None, 200));
        assert_eq!(parallelism(&wide, 8), 8);
        assert_eq!(parallelism(&task(3, &[(0, 1), (1, 2)]), 8), 1);
    }
}
