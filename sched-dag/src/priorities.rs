//! Static priorities from the graph, for apps that give none.
//!
//! A subtask's *remaining path* is the longest path from its start to the end
//! of the DAG, its own WCET included. The subtask with the longest remaining
//! path comes first (the "highest level first" order; T. C. Hu, Operations
//! Research 9, 1961, and, as upward rank, Topcuoglu, Hariri and Wu, IEEE TPDS
//! 13, 2002); between equal paths the order of registration decides.
//!
//! If the WCET of any subtask of the DAG is unknown, every subtask counts 1, so
//! that the path's number of subtasks decides: to mix known and invented times
//! would favour whatever happened to be measured.
//!
//! Between DAGs, [`verify`](crate::verify()) gives derived priorities deadline
//! monotonically: all subtasks of the DAG with the shorter relative deadline
//! come before all of the other (then the order of the commit), which is the
//! order that the fixed-priority tests assume. Where some DAGs have priorities
//! and others have not, the derived ones come after all that are given.

use alloc::vec;
use alloc::vec::Vec;

use crate::graph::Graph;
use crate::ids::to_u32;
use crate::order::sorted_by_key;

/// Returns each subtask's position in the order of remaining paths.
pub(crate) fn ranks(wcets_ns: &[Option<u64>], graph: &Graph) -> Vec<u32> {
    let known: Option<Vec<u64>> = wcets_ns.iter().copied().collect();
    let weights = known.unwrap_or_else(|| vec![1; wcets_ns.len()]);
    // The sum of all WCETs fits, so no path overflows.
    let paths = graph.levels(&weights);
    // Stable, so equal paths stay in the order of registration.
    let order = sorted_by_key(paths.len(), |subtask| core::cmp::Reverse(paths[subtask]));
    let mut ranks = vec![0; paths.len()];
    for (rank, &subtask) in order.iter().enumerate() {
        ranks[subtask] = to_u32(rank);
    }
    ranks
}
