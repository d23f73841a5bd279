//! The precedence graph of one DAG in a form that is quick to walk.
//!
//! Everything here is linear in subtasks and edges, and nothing recurs: a
//! chain of many thousand subtasks shall not need a deep stack.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use crate::ids::{SubtaskId, to_u32};
use crate::task_set::Adjacency;

/// Both directions of a DAG's edges.
pub(super) struct Graph {
    pub(super) predecessors: Adjacency,
    pub(super) successors: Adjacency,
}

impl Graph {
    /// Makes the graph of `count` subtasks from edges in range, which may repeat.
    pub(super) fn new(count: usize, edges: &[(u32, u32)]) -> Self {
        // A radix sort by successor, then by predecessor; then repeated edges
        // are neighbours.
        let by_successor = sort_by(count, edges, |edge| edge.1);
        let mut sorted = sort_by(count, &by_successor, |edge| edge.0);
        sorted.dedup();
        let successors = adjacency(count, &sorted, |edge| edge);
        let by_successor = sort_by(count, &sorted, |edge| edge.1);
        let predecessors = adjacency(count, &by_successor, |(from, to)| (to, from));
        Self {
            predecessors,
            successors,
        }
    }

    /// Returns the number of subtasks.
    pub(super) fn len(&self) -> usize {
        self.successors.starts.len() - 1
    }

    /// Returns all subtasks that are neither in a cycle nor after one, each
    /// after its predecessors (Kahn, Communications of the ACM 5, 1962).
    pub(super) fn topological_order(&self) -> Vec<SubtaskId> {
        let mut missing: Vec<u32> = Vec::with_capacity(self.len());
        let mut order: Vec<SubtaskId> = Vec::with_capacity(self.len());
        for subtask in self.subtasks() {
            let predecessors = self.predecessors.of(subtask).len();
            missing.push(to_u32(predecessors));
            if predecessors == 0 {
                order.push(subtask);
            }
        }
        let mut next = 0;
        while let Some(&subtask) = order.get(next) {
            next += 1;
            for &successor in self.successors.of(subtask) {
                missing[successor.index()] -= 1;
                if missing[successor.index()] == 0 {
                    order.push(successor);
                }
            }
        }
        order
    }

    /// Returns for each subtask the number of its part, in which the edges'
    /// directions are ignored, and how many parts there are.
    pub(super) fn parts(&self) -> (Vec<u32>, usize) {
        const UNSEEN: u32 = u32::MAX;
        let mut part_of = vec![UNSEEN; self.len()];
        let mut parts = 0;
        let mut pending: Vec<SubtaskId> = Vec::new();
        for first in self.subtasks() {
            if part_of[first.index()] != UNSEEN {
                continue;
            }
            part_of[first.index()] = to_u32(parts);
            pending.push(first);
            while let Some(subtask) = pending.pop() {
                let neighbours = self
                    .predecessors
                    .of(subtask)
                    .iter()
                    .chain(self.successors.of(subtask));
                for &neighbour in neighbours {
                    if part_of[neighbour.index()] == UNSEEN {
                        part_of[neighbour.index()] = to_u32(parts);
                        pending.push(neighbour);
                    }
                }
            }
            parts += 1;
        }
        (part_of, parts)
    }

    /// Returns the subtasks in the order of registration.
    pub(super) fn subtasks(&self) -> impl Iterator<Item = SubtaskId> + use<> {
        (0..to_u32(self.len())).map(SubtaskId)
    }
}

fn sort_by(count: usize, edges: &[(u32, u32)], end: impl Fn((u32, u32)) -> u32) -> Vec<(u32, u32)> {
    let mut next = vec![0_usize; count + 1];
    for &edge in edges {
        next[end(edge) as usize + 1] += 1;
    }
    for index in 0..count {
        next[index + 1] += next[index];
    }
    let mut sorted = vec![(0, 0); edges.len()];
    for &edge in edges {
        let place = &mut next[end(edge) as usize];
        sorted[*place] = edge;
        *place += 1;
    }
    sorted
}

/// Returns the lists of neighbours from edges sorted by the subtask that
/// `orient` puts first.
fn adjacency(
    count: usize,
    sorted: &[(u32, u32)],
    orient: impl Fn((u32, u32)) -> (u32, u32),
) -> Adjacency {
    let mut starts = vec![0_u32; count + 1];
    for &edge in sorted {
        starts[orient(edge).0 as usize + 1] += 1;
    }
    for index in 0..count {
        starts[index + 1] += starts[index];
    }
    let neighbours: Box<[SubtaskId]> = sorted
        .iter()
        .map(|&edge| SubtaskId(orient(edge).1))
        .collect();
    Adjacency {
        starts: starts.into_boxed_slice(),
        neighbours,
    }
}
