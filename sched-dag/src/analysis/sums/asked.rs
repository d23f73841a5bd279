//! What one DAG asks a tree: the sums over those that may outrank it.

use alloc::rc::Rc;
use alloc::vec;

use super::stretch::{CURVES, Sums, half};
use super::{Node, Tree};
use crate::analysis::above::Above;
use crate::analysis::interference::Clip;
use crate::analysis::set::Set;
use crate::analysis::workload::Piece;

/// What one DAG asks.
pub(super) struct Asked<'a> {
    pub(super) tree: &'a Tree,
    pub(super) set: &'a Set<'a>,
    pub(super) place: usize,
    /// Jobs with later deadlines do not count.
    pub(super) limit_ns: Option<u64>,
}

impl Asked<'_> {
    /// Goes through the stretches that may outrank the DAG: through the halves of one, or the
    /// one place of it, where it is not taken.
    pub(super) fn walk(&self, mut take: impl FnMut(&Node) -> bool, mut one: impl FnMut(usize)) {
        let (tree, end) = (self.tree, self.tree.ends[self.place]);
        let mut open = vec![(1, 0, tree.nodes.len() / 2)];
        while let Some((node, start, count)) = open.pop() {
            let after = start + count;
            let is_whole = after <= end && !(start..after).contains(&self.place);
            let is_done = start >= end || is_whole && take(&tree.nodes[node]);
            if !is_done && count > 1 {
                let half = count / 2;
                open.push((2 * node + 1, start + half, half));
                open.push((2 * node, start, half));
            } else if !is_done && is_whole {
                one(start);
            }
        }
        let each = tree.each.iter().copied();
        each.filter(|&place| place < end && place != self.place)
            .for_each(one);
    }

    /// Makes a sum over the stretches: by curves where they tell, else one by one.
    fn sum(&self, mut add: impl FnMut(&Sums) -> bool, mut one: impl FnMut(usize, u64)) {
        let take = |node: &Node| {
            let counts = |sums: &&Rc<Sums>| sums.lengths_ns(self.limit_ns) > 0;
            node.sums
                .as_ref()
                .filter(counts)
                .is_none_or(|sums| add(sums))
        };
        self.walk(take, |place| {
            let response_ns = self.tree.responses[place];
            response_ns
                .into_iter()
                .for_each(|response_ns| one(self.tree.order[place], response_ns));
        });
    }
}

impl Above for Asked<'_> {
    fn is_empty(&self) -> bool {
        let end = self.tree.ends[self.place];
        end == usize::from(self.place < end)
    }

    fn least_waiting_ns(&self, cores: usize) -> u64 {
        let (mut lengths_ns, mut longest_ns) = (0, 0);
        let add = |sums: &Sums| {
            lengths_ns += sums.lengths_ns(self.limit_ns);
            longest_ns = longest_ns.max(sums.longest_ns);
            true
        };
        self.sum(add, |_, _| ());
        let cores = cores as u128;
        let is_busy = lengths_ns > cores * u128::from(longest_ns);
        let waiting_ns = if is_busy {
            lengths_ns.div_ceil(cores)
        } else {
            0
        };
        u64::try_from(waiting_ns).unwrap_or(u64::MAX)
    }

    fn has_sums(&self) -> bool {
        true
    }

    fn add_to(
        &self,
        times: (u64, u64),
        clip: Clip,
        cores: usize,
        by_sums: bool,
        [plain, clipped]: [&mut [Piece]; 2],
    ) {
        let mut sum = [Piece::NONE; CURVES];
        let add = |sums: &Sums| {
            let is_settled = by_sums && sums.settled_ns <= times.0;
            let by = sums
                .by(self.tree, self.limit_ns, times.0)
                .filter(|_| is_settled);
            if let Some(by) = by {
                sum = [0, 1, 2, 3].map(|curve| sum[curve].and(sums.at(by, curve, times.0)));
            }
            by.is_some()
        };
        self.sum(add, |dag, response_ns| {
            let other = self.set.other(dag, response_ns, self.limit_ns);
            other.add_to(times, clip, cores, plain, clipped);
        });
        let [all, by_chains, on_half, on_one] = sum;
        for (j, (plain, clipped)) in plain.iter_mut().zip(clipped).enumerate() {
            let at_least = match cores - j {
                some if some < half(cores) => on_one,
                _ => on_half,
            };
            *plain = plain.and(if j == 0 { all } else { at_least });
            *clipped = clipped.and(if j == 0 { by_chains } else { at_least });
        }
    }

    fn on_all_cores(&self, window_ns: u64) -> Piece {
        let (mut sum, mut rest) = (Piece::NONE, Piece::NONE);
        let add = |sums: &Sums| {
            let by = sums.by(self.tree, self.limit_ns, window_ns);
            sum = by.map_or(sum, |by| sum.and(sums.at(by, 0, window_ns)));
            by.is_some()
        };
        self.sum(add, |dag, response_ns| {
            let other = self.set.other(dag, response_ns, self.limit_ns);
            rest = rest.and(other.on_all_cores().at(window_ns));
        });
        sum.and(rest)
    }
}
