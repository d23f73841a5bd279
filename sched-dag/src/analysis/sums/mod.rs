//! The workloads of many DAGs as sums.
//!
//! A DAG's equations have the workloads of all DAGs that may outrank it. To add them up for
//! each window of each DAG takes time quadratic in their number. So they are added up as
//! functions: a [`Curve`](curve::Curve) has the pieces of a sum, and a tree over the DAGs, in
//! the order in which they are visited, has the curves of each *stretch*. The DAGs that may
//! outrank one are the first of that order, without itself: some log n stretches. A stretch is
//! added up again when its last DAG has been visited, if a bound in it has changed. So each DAG
//! finds the bounds that it would find one by one, and a round over all takes n log n.
//!
//! Curves know the window and not for how long the job waits. From some window on that
//! makes no difference: by the time that a core does something else than such a workload,
//! `L - W(L) / cores`, which never shrinks as L grows. Where it is at least the job's length,
//! the workload fits into the time that the job waits, which is `L - length`. From there on,
//! for the longest of all jobs, the stretch is *settled*.
//!
//! Under EDF a DAG with deadline `D_i` delays a job with deadline D by a function of the
//! smaller of `L - V / p` and `D - D_i` (see `workload`). Where that is the first one, for all
//! parts of all DAGs of a stretch, the curves by the window tell; where it is the second one,
//! those by the deadline. In the order of the deadlines few DAGs are in between.
//!
//! A stretch that is not settled, or in between, is asked in halves, and its DAGs one by one in
//! the end. Few are: a DAG of length l executes `min(l, x)` at least while the job waits for x,
//! so no solution has an `m x` below the sum of the lengths, once that is above m times the
//! longest; see [`Above::least_waiting_ns`]. With deadlines, `min(l, D - D_i + R_i)` takes the
//! place of l.
//!
//! There are four curves: all on all cores; the same clipped to its chains; and that on half of
//! the cores and on one, which is never more than on some more. By the last two, forms with
//! chains of the job are only held to be unproven; where they do not tell, all are asked one
//! by one.

mod asked;
mod curve;
mod stretch;

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;

use asked::Asked;
use stretch::Sums;

use super::above::Above;
use super::set::{Front, Set};

/// The DAGs at their places in the order, with what is added up.
struct Tree {
    order: Vec<usize>,
    /// The place of each DAG.
    places: Vec<usize>,
    /// How many may outrank the DAG at each place: the first of the order, and if it is among
    /// them, it counts.
    ends: Vec<usize>,
    /// Whether jobs count up to a deadline only.
    deadlines_limit: bool,
    responses: Vec<Option<u64>>,
    /// The root at 1, the halves of node v at 2 v and 2 v + 1, and the places in the end.
    nodes: Vec<Node>,
    /// Places without curves, which are asked one by one.
    each: Vec<usize>,
    /// No equation has a longer job.
    longest_ns: u64,
    /// The longest window of the curves, and their last deadline.
    until_ns: u64,
}

/// A stretch of the order.
#[derive(Clone, Default)]
struct Node {
    /// The first in the order of the commit that has no bound.
    failed: Option<usize>,
    /// Of those that have curves, if any.
    sums: Option<Rc<Sums>>,
    /// Whether a bound is another one than in the round before.
    has_changed: bool,
}

/// Makes a front with sums.
pub(super) fn front(
    set: &Set<'_>,
    order: &[usize],
    may_outrank: &dyn Fn(usize, usize) -> bool,
    deadlines_limit: bool,
) -> Box<dyn Front> {
    let longest = set.tasks.iter().map(|task| task.length_ns()).max();
    let until = set.tasks.iter().map(|task| task.relative_deadline_ns());
    let mut places = vec![0; order.len()];
    for (place, &dag) in order.iter().enumerate() {
        places[dag] = place;
    }
    let end =
        |&dag: &usize| order.partition_point(|&other| other == dag || may_outrank(other, dag));
    Box::new(Tree {
        order: order.to_vec(),
        places,
        ends: order.iter().map(end).collect(),
        deadlines_limit,
        responses: vec![None; order.len()],
        nodes: vec![Node::default(); 2 * order.len().next_power_of_two()],
        each: Vec::new(),
        longest_ns: longest.unwrap_or(0),
        until_ns: until.max().unwrap_or(0),
    })
}

impl Front for Tree {
    fn goes_down(&self) -> bool {
        let mut ends = self.ends.iter().zip(1..);
        ends.all(|(&end, after)| end <= after)
    }

    fn among<'a>(
        &'a self,
        set: &'a Set<'a>,
        dag: usize,
        limit_ns: Option<u64>,
    ) -> Result<Box<dyn Above + 'a>, usize> {
        let asked = Asked {
            tree: self,
            set,
            place: self.places[dag],
            limit_ns,
        };
        let mut failed = None;
        let all = |node: &Node| {
            failed = failed.into_iter().chain(node.failed).min();
            true
        };
        asked.walk(all, |_| ());
        failed.map_or(Ok(Box::new(asked)), Err)
    }

    fn put(&mut self, set: &Set<'_>, dag: usize, response_ns: Option<u64>) {
        let place = self.places[dag];
        let mut node = self.nodes.len() / 2 + place;
        let has_failed = self.nodes[node].failed.is_some();
        let is_same = has_failed == response_ns.is_none() && self.responses[place] == response_ns;
        self.nodes[node].has_changed = !is_same;
        if !is_same {
            let sums = response_ns.and_then(|bound_ns| Sums::of(self, set, dag, bound_ns));
            self.each.retain(|&each| each != place);
            if sums.is_none() && response_ns.is_some() {
                self.each.push(place);
            }
            self.responses[place] = response_ns;
            self.nodes[node].failed = response_ns.is_none().then_some(dag);
            self.nodes[node].sums = sums.map(Rc::new);
        }
        let is_last = place + 1 == self.responses.len();
        while node > 1 && (is_last || node % 2 == 1) {
            node /= 2;
            let [one, two] = [2 * node, 2 * node + 1].map(|half| &self.nodes[half]);
            let has_changed = one.has_changed || two.has_changed;
            if has_changed {
                self.nodes[node] = one.and(two);
            }
            self.nodes[node].has_changed = has_changed;
        }
    }
}

impl Node {
    fn and(&self, other: &Self) -> Self {
        let sums = match (&self.sums, &other.sums) {
            (Some(one), Some(two)) => Some(Rc::new(one.and(two))),
            (one, two) => one.clone().or_else(|| two.clone()),
        };
        Self {
            failed: self.failed.into_iter().chain(other.failed).min(),
            sums,
            has_changed: true,
        }
    }
}
