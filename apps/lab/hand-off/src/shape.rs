//! The graphs that are measured, as lists of edges.
//!
//! Nothing here is of this project: to time another scheduler on the same graphs,
//! these few lines and empty functions are enough. Subtasks are
//! numbered from 0 in topological order; 0 is the one source, the last one is the
//! one sink.

use alloc::vec::Vec;

use random::Random;

/// The number of subtasks side by side in a layered graph.
const LAYER: usize = 32;

/// A graph to be measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// So many subtasks, one after the other; at least 1.
    Chain(usize),
    /// A source, this number of subtasks side by side, a sink.
    ForkJoin(usize),
    /// A random graph in layers.
    ///
    /// Between source and sink are `subtasks - 2` subtasks, in layers of
    /// 32; the last layer has what is left. One of the first layer follows
    /// the source. One of any other layer follows 3 of the layer before, each
    /// drawn by itself, uniformly; one that is drawn twice counts once. The sink
    /// follows all that have no other successor.
    ///
    /// The draws are those of SplitMix64 (Steele, Lea, Flood, OOPSLA 2014, doi
    /// 10.1145/2660193.2660195) started with `seed`; a draw's high 5 bits are the
    /// place in the layer. They are made in the order of the subtasks.
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

    /// Returns the edges, from smaller to larger numbers, ordered by the latter;
    /// none stands twice.
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
