//! The measured graphs, as lists of edges.
//!
//! Nothing here depends on the scheduler, and only `random` is of this project: a few such lines
//! and empty functions are enough to time another scheduler on the same graphs. Subtasks are
//! numbered from 0 in topological order; 0 is the only source, the last number is the only sink.

use alloc::vec::Vec;

use random::Random;

/// The number of subtasks side by side in a layered graph.
const LAYER: usize = 32;

/// A graph to measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// The given number of subtasks, one after the other; at least 1.
    Chain(usize),
    /// A source, this number of subtasks side by side, a sink.
    ForkJoin(usize),
    /// A random graph in layers.
    ///
    /// Between source and sink are `subtasks - 2` subtasks, in layers of 32; the last layer has the
    /// rest. Each subtask of the first layer follows the source. Each subtask of any other layer
    /// follows 3 subtasks of the layer before, each drawn independently and uniformly; a subtask
    /// drawn twice counts once. The sink follows all subtasks without another successor.
    ///
    /// The draws come from SplitMix64 (Steele, Lea, Flood, OOPSLA 2014, doi
    /// 10.1145/2660193.2660195), started with `seed`; the high 5 bits of a draw are the place in
    /// the layer. The draws are made in the order of the subtasks.
    Layered {
        /// The number of subtasks, source and sink included; at least 3.
        subtasks: usize,
        /// The state of the draws.
        seed: u64,
    },
}

impl Shape {
    /// Returns the number of subtasks.
    pub const fn subtasks(self) -> usize {
        match self {
            Self::Chain(subtasks) | Self::Layered { subtasks, .. } => subtasks,
            Self::ForkJoin(parallel) => parallel + 2,
        }
    }

    /// Returns the edges, each once, from smaller to larger numbers, ordered by the larger.
    pub fn edges(self) -> Vec<(usize, usize)> {
        let sink = self.subtasks() - 1;
        match self {
            Self::Chain(_) => (0..sink).map(|earlier| (earlier, earlier + 1)).collect(),
            Self::ForkJoin(_) => {
                let fork = (1..sink).map(|branch| (0, branch));
                fork.chain((1..sink).map(|branch| (branch, sink))).collect()
            }
            Self::Layered { seed, .. } => layered(sink, seed),
        }
    }
}

fn layered(sink: usize, seed: u64) -> Vec<(usize, usize)> {
    const DRAWS: usize = 3;
    let mut random = Random::new(seed);
    let mut edges = Vec::with_capacity(sink * DRAWS);
    let mut has_successor = alloc::vec![false; sink];
    for subtask in 1..sink {
        let layer = (subtask - 1) / LAYER;
        if layer == 0 {
            edges.push((0, subtask));
            continue;
        }
        let (first, last) = (1 + (layer - 1) * LAYER, layer * LAYER);
        let mut predecessors = [(); DRAWS].map(|()| random.within(first..=last));
        predecessors.sort_unstable();
        for (number, &earlier) in predecessors.iter().enumerate() {
            if number == 0 || predecessors[number - 1] != earlier {
                edges.push((earlier, subtask));
                has_successor[earlier] = true;
            }
        }
    }
    let ends = (1..sink).filter(|subtask| !has_successor[*subtask]);
    edges.extend(ends.map(|subtask| (subtask, sink)));
    edges
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_and_a_fork_join_are_what_they_are_called() {
        assert_eq!(Shape::Chain(4).edges(), [(0, 1), (1, 2), (2, 3)]);
        assert_eq!(Shape::ForkJoin(2).edges(), [(0, 1), (0, 2), (1, 3), (2, 3)]);
    }

    #[test]
    fn a_layered_graph_has_one_source_one_sink_and_three_edges_a_subtask() {
        for subtasks in [3, 10, 35, 100, 1000, 10_000] {
            let shape = Shape::Layered { subtasks, seed: 1 };
            let edges = shape.edges();
            assert!(edges.iter().all(|(earlier, later)| earlier < later));
            for subtask in 0..subtasks {
                let is_source = !edges.iter().any(|edge| edge.1 == subtask);
                let is_sink = !edges.iter().any(|edge| edge.0 == subtask);
                assert_eq!(
                    (is_source, is_sink),
                    (subtask == 0, subtask + 1 == subtasks)
                );
            }
        }
        // The very graph: a copy of it elsewhere can be checked.
        let subtasks = 1000;
        let edges = Shape::Layered { subtasks, seed: 1 }.edges();
        let sum: usize = edges.iter().map(|edge| edge.0 * 1000 + edge.1).sum();
        assert_eq!((edges.len(), sum), (2902, 1_396_779_593));
    }
}
