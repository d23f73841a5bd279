//! The precedence graph of one DAG in a form that is quick to walk.
//!
//! Everything here is linear in subtasks and edges, and nothing recurs: a chain of many thousand
//! subtasks shall not need a deep stack.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::{Add, Range};

use crate::ids::{SubtaskId, to_u32};

/// For each subtask a list of neighbours, all lists in one allocation.
#[derive(Clone, Debug)]
pub(crate) struct AdjacencyList {
    /// `starts[v]..starts[v + 1]` is the range of `v`'s neighbours.
    starts: Box<[u32]>,
    pub(crate) neighbours: Box<[SubtaskId]>,
}

/// Both directions of a DAG's edges, and the properties derived from them.
#[derive(Clone, Debug)]
pub(crate) struct Graph {
    /// The predecessors of each subtask, each once, ascending.
    pub(crate) predecessors: AdjacencyList,
    /// The successors of each subtask, each once, ascending.
    pub(crate) successors: AdjacencyList,
    /// The subtasks without predecessor, ascending.
    pub(crate) sources: Box<[SubtaskId]>,
    /// The subtasks without successor, ascending.
    pub(crate) sinks: Box<[SubtaskId]>,
    /// All subtasks neither in a cycle nor after a cycle, each after its predecessors.
    pub(crate) topological_order: Box<[SubtaskId]>,
}

impl AdjacencyList {
    /// Lists for each subtask the other ends of its edges, in the order of the edges, which may be
    /// stated in the other direction: a counting sort.
    fn new(count: usize, edges: &[(u32, u32)], is_reversed: bool) -> Self {
        let orient = |&(from, to): &(u32, u32)| match is_reversed {
            true => (to as usize, SubtaskId(from)),
            false => (from as usize, SubtaskId(to)),
        };
        let mut starts = vec![0_u32; count + 1];
        for edge in edges {
            starts[orient(edge).0 + 1] += 1;
        }
        for index in 0..count {
            starts[index + 1] += starts[index];
        }
        let mut next = starts.clone();
        let mut neighbours = vec![SubtaskId(0); edges.len()];
        for (here, there) in edges.iter().map(orient) {
            neighbours[next[here] as usize] = there;
            next[here] += 1;
        }
        Self {
            starts: starts.into_boxed_slice(),
            neighbours: neighbours.into_boxed_slice(),
        }
    }

    pub(crate) fn neighbours(&self, subtask: SubtaskId) -> &[SubtaskId] {
        &self.neighbours[self.range(subtask.index())]
    }

    /// Returns the range of a subtask's neighbours.
    pub(crate) fn range(&self, subtask: usize) -> Range<usize> {
        self.starts[subtask] as usize..self.starts[subtask + 1] as usize
    }

    /// Returns all subtasks in the order of registration.
    fn subtasks(&self) -> impl Iterator<Item = SubtaskId> + use<> {
        (0..to_u32(self.starts.len() - 1)).map(SubtaskId)
    }

    /// Returns each subtask with each of its neighbours.
    pub(crate) fn edges(&self) -> Vec<(u32, u32)> {
        let of = |from| self.neighbours(from).iter().map(move |to| (from.0, to.0));
        self.subtasks().flat_map(of).collect()
    }

    fn without_neighbours(&self) -> Box<[SubtaskId]> {
        let is_end = |subtask: &SubtaskId| self.neighbours(*subtask).is_empty();
        self.subtasks().filter(is_end).collect()
    }
}

impl Graph {
    /// Makes the graph of `count` subtasks from edges in range, which may repeat.
    pub(crate) fn new(count: usize, edges: &[(u32, u32)]) -> Self {
        // A radix sort by successor, then by predecessor; afterwards repeated edges are adjacent.
        let by_successor = AdjacencyList::new(count, edges, true).edges();
        let mut sorted = AdjacencyList::new(count, &by_successor, true).edges();
        sorted.dedup();
        let successors = AdjacencyList::new(count, &sorted, false);
        let predecessors = AdjacencyList::new(count, &sorted, true);
        let mut graph = Self {
            sources: predecessors.without_neighbours(),
            sinks: successors.without_neighbours(),
            predecessors,
            successors,
            topological_order: Box::default(),
        };
        graph.topological_order = graph.order();
        graph
    }

    /// Orders the subtasks (Kahn, Communications of the ACM 5, 1962).
    fn order(&self) -> Box<[SubtaskId]> {
        let mut missing = self.predecessor_counts();
        let mut order = self.sources.to_vec();
        let mut next = 0;
        while let Some(&subtask) = order.get(next) {
            next += 1;
            for &successor in self.successors.neighbours(subtask) {
                missing[successor.index()] -= 1;
                if missing[successor.index()] == 0 {
                    order.push(successor);
                }
            }
        }
        order.into_boxed_slice()
    }

    /// Returns the number of subtasks.
    pub(crate) fn len(&self) -> usize {
        self.successors.starts.len() - 1
    }

    /// Reports whether each subtask has a place in the topological order.
    pub(crate) fn is_acyclic(&self) -> bool {
        self.topological_order.len() == self.len()
    }

    /// Returns the subtasks in the order of registration.
    pub(crate) fn subtasks(&self) -> impl Iterator<Item = SubtaskId> + use<> {
        self.successors.subtasks()
    }

    /// Returns the number of predecessors of each subtask.
    pub(crate) fn predecessor_counts(&self) -> Vec<usize> {
        let count = |subtask| self.predecessors.neighbours(subtask).len();
        self.subtasks().map(count).collect()
    }

    /// Returns for each subtask the largest sum of weights along a path beginning there. No sum may
    /// overflow.
    pub(crate) fn levels<W>(&self, weights: &[W]) -> Vec<W>
    where
        W: Copy + Default + Ord + Add<Output = W>,
    {
        let mut levels = vec![W::default(); weights.len()];
        for &subtask in self.topological_order.iter().rev() {
            let successors = self.successors.neighbours(subtask).iter();
            let rest = successors.map(|next| levels[next.index()]).max();
            levels[subtask.index()] = weights[subtask.index()] + rest.unwrap_or_default();
        }
        levels
    }

    /// Returns for each subtask the number of its connected part, ignoring the edges' directions,
    /// and the number of parts.
    pub(crate) fn parts(&self) -> (Vec<u32>, usize) {
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
                let predecessors = self.predecessors.neighbours(subtask).iter();
                for &neighbour in predecessors.chain(self.successors.neighbours(subtask)) {
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
}
