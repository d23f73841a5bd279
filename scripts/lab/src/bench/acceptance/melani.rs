//! Graphs by A. Melani's generator (A. Melani, M. Bertogna, V. Bonifaci, A. Marchetti-Spaccamela,
//! G. Buttazzo, ECRTS 2015), with the numbers of awkernel's comparison of scheduling methods.
//!
//! A subtask is expanded into branches between a fork and a join. A branch is expanded again with a
//! chance of 80 %, up to a depth. Then edges are added from subtasks to subtasks of later levels,
//! each with a chance of 10 %; edges made needless by a longer way are left out. WCETs are 1 to
//! 100.

use random::Random;
use sched_dag::analysis::Task;

/// The chance of a branch to be expanded, and of an edge to be added, in percent.
const EXPANDED: u64 = 80;
const ADDED: u64 = 10;

/// Draws a graph with at most `branches` branches a fork, and forks in forks up to a depth.
pub(super) fn graph(random: &mut Random, branches: usize, depth: i32) -> Task {
    let mut graph = NestedForks {
        levels: vec![depth, -depth],
        successors: vec![vec![], vec![]],
    };
    graph.expand(random, (0, 1), depth - 1, branches);
    graph.add_edges(random);
    let wcets = graph.levels.iter().map(|_| random.within(1..=100));
    let wcets: Vec<u64> = wcets.collect();
    let mut edges = Vec::new();
    for (from, successors) in graph.successors.iter().enumerate() {
        edges.extend(successors.iter().map(|&to| (from, to)));
    }
    Task::new(1, 1, wcets, &edges).expect("edges lead to later levels")
}

/// A growing graph.
struct NestedForks {
    /// For each subtask, the depth of forks still possible below; negative for joins.
    levels: Vec<i32>,
    successors: Vec<Vec<usize>>,
}

impl NestedForks {
    fn push(&mut self, level: i32) -> usize {
        self.levels.push(level);
        self.successors.push(vec![]);
        self.levels.len() - 1
    }

    /// Puts branches between a fork and a join.
    fn expand(&mut self, random: &mut Random, ends: (usize, usize), level: i32, most: usize) {
        for _ in 0..random.within(2..=most) {
            let from = self.push(level);
            self.successors[ends.0].push(from);
            if level > 0 && random.chance(EXPANDED) {
                let to = self.push(-level);
                self.successors[to].push(ends.1);
                self.expand(random, (from, to), level - 1, most);
            } else {
                self.successors[from].push(ends.1);
            }
        }
    }

    /// Adds edges, then takes out implied edges.
    fn add_edges(&mut self, random: &mut Random) {
        let count = self.levels.len();
        for from in 0..count {
            for to in 0..count {
                let is_later = self.levels[from] > self.levels[to];
                if is_later && !self.reached(from)[to] && random.chance(ADDED) {
                    self.successors[from].push(to);
                }
            }
        }
        for from in 0..count {
            let own = self.successors[from].clone();
            let by_way = own.iter().map(|&next| self.reached(next));
            let by_way: Vec<Vec<bool>> = by_way.collect();
            self.successors[from].retain(|&to| !by_way.iter().any(|reached| reached[to]));
        }
    }

    /// Returns for each subtask whether edges lead there.
    fn reached(&self, from: usize) -> Vec<bool> {
        let mut reached = vec![false; self.levels.len()];
        let mut open = vec![from];
        while let Some(next) = open.pop() {
            for &to in &self.successors[next] {
                if !reached[to] {
                    reached[to] = true;
                    open.push(to);
                }
            }
        }
        reached
    }
}

#[test]
fn graphs_have_one_source_one_sink_and_no_needless_edge() {
    let mut random = Random::new(62);
    for _ in 0..50 {
        let task = graph(&mut random, 4, 2);
        let count = task.subtask_count();
        let of = |from| task.successors(from).map(move |to| (from, to));
        let edges: Vec<(usize, usize)> = (0..count).flat_map(of).collect();
        let is_end =
            |end: fn(&(usize, usize)) -> usize, of| edges.iter().all(|edge| end(edge) != of);
        assert!((0..count).filter(|&of| is_end(|edge| edge.1, of)).eq([0]));
        assert!((0..count).filter(|&of| is_end(|edge| edge.0, of)).eq([1]));
        // 4 branches of 4 with their ends.
        assert!((4..=2 + 4 * 2 + 16).contains(&count), "{count}");
        for &(from, to) in &edges {
            let way = edges.iter().any(|&(first, middle)| {
                first == from && middle != to && edges.contains(&(middle, to))
            });
            assert!(!way, "{from} -> {to}");
        }
    }
}
