//! Random graphs of subtasks, of four shapes.
//!
//! Edges always lead from a lower number to a higher one, so no graph has a
//! cycle. Only fork-join graphs and chains have one source and one sink; the
//! other two shapes have any number of each.

use alloc::vec::Vec;

use common::random::Random;

/// An edge: the earlier subtask and the later one, by number.
pub(crate) type Edge = (usize, usize);

/// The most layers of a layered graph.
const MOST_LAYERS: u64 = 4;

/// Draws the edges of a graph with `subtasks` subtasks, at least 3.
pub(crate) fn draw(subtasks: usize, random: &mut Random) -> Vec<Edge> {
    match random.within(0..=6) {
        0 | 1 => fork_join(subtasks),
        2 | 3 => layered(subtasks, random),
        4 | 5 => any(subtasks, random),
        _ => (1..subtasks).map(|later| (later - 1, later)).collect(),
    }
}

/// One source, one sink, and all others side by side between them.
fn fork_join(subtasks: usize) -> Vec<Edge> {
    let sink = subtasks - 1;
    (1..sink)
        .flat_map(|branch| [(0, branch), (branch, sink)])
        .collect()
}

/// Layers, each subtask of which has one to three predecessors in the layer
/// before, and now and then one further back.
fn layered(subtasks: usize, random: &mut Random) -> Vec<Edge> {
    let layers = random.within(2..=MOST_LAYERS);
    let mut layer_of: Vec<u64> = (0..subtasks).map(|_| random.within(1..=layers)).collect();
    layer_of.sort_unstable();
    let mut edges = Vec::new();
    for later in 0..subtasks {
        // The nearest layer before that has any subtask.
        let before = layer_of[..later]
            .iter()
            .rposition(|layer| *layer < layer_of[later]);
        let Some(last) = before else {
            continue;
        };
        let first = layer_of[..=last].partition_point(|layer| *layer < layer_of[last]);
        for _ in 0..random.within(1..=3) {
            edges.push((first + random.index(last + 1 - first), later));
        }
        if random.once_in(4) {
            edges.push((random.index(last + 1), later));
        }
    }
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// Every edge with the same probability (Erdős and Rényi's random graphs, as
/// Cordeiro et al. direct them, SIMUTools 2010).
fn any(subtasks: usize, random: &mut Random) -> Vec<Edge> {
    let rarity = random.within(2..=6);
    let mut edges = Vec::new();
    for later in 1..subtasks {
        edges.extend(
            (0..later)
                .filter(|_| random.once_in(rarity))
                .map(|earlier| (earlier, later)),
        );
    }
    edges
}

/// Returns the length of the longest path, given each subtask's.
pub(crate) fn longest_path_ns(lengths_ns: &[u64], edges: &[Edge]) -> u64 {
    let mut ends_ns = lengths_ns.to_vec();
    for later in 0..lengths_ns.len() {
        let before = edges.iter().filter(|edge| edge.1 == later);
        let start_ns = before.map(|edge| ends_ns[edge.0]).max().unwrap_or(0);
        ends_ns[later] += start_ns;
    }
    ends_ns.into_iter().max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_path_of_a_fork_join_is_that_of_its_longest_branch() {
        assert_eq!(longest_path_ns(&[1, 5, 9, 2, 3], &fork_join(5)), 13);
        assert_eq!(longest_path_ns(&[4, 2], &[]), 4);
    }
}
