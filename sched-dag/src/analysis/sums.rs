//! The workloads of many DAGs as sums.
//!
//! Where priorities do not interleave, a DAG's equations have the workloads of all DAGs above
//! it, and those of the next DAG have the same and one more. To add them up for each window of
//! each DAG takes time quadratic in their number. So they are added up once, as functions of
//! the window: a [`Curve`] has the pieces of a sum, and a *block* the curves of some DAGs. A
//! DAG comes as a block of its own, and two blocks of one size become one; so n DAGs are in
//! log n blocks, and each is added up log n times.
//!
//! Curves know the window and not for how long the job waits. From some window on that
//! makes no difference: by the time that a core does something else than such a workload,
//! `L - W(L) / cores`, which never shrinks as L grows. Where it is at least the job's length,
//! the workload fits into the time that the job waits, which is `L - length`. From there on,
//! for the longest of all jobs, the block is *settled*. At shorter windows its DAGs are asked
//! one by one. Few windows are: a DAG of length l above executes `min(l, x)` at least while
//! the job waits for x, so no solution has an `m x` below the sum of the lengths, once that is
//! above m times the longest; see [`Above::least_waiting_ns`].
//!
//! A block has three curves: all on all cores; the same clipped to its chains; and that on one
//! core, which is never more than on two or three. By the last one, forms with chains of the
//! job are only held to be unproven; where it does not tell, all are asked one by one.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::above::Above;
use super::interference::{Clip, Other};
use super::set::{Front, Set};
use super::workload::Piece;

/// The most pieces of one DAG's curve; one that has more by the longest deadline stays alone.
const MOST_PIECES: usize = 512;

/// The DAGs that were added, almost all of them in sums.
struct Blocks {
    /// Those that are asked one by one.
    each: Vec<Other>,
    blocks: Vec<Block>,
    /// No equation has a longer job.
    longest_ns: u64,
    /// The longest window of the curves.
    until_ns: u64,
    /// The sum of the lengths of the DAGs in blocks.
    lengths_ns: u128,
    /// The first in the order of the commit that has no bound.
    failed: Option<usize>,
}

struct Block {
    members: Vec<Other>,
    settled_ns: u64,
    curves: [Curve; 3],
}

/// A sum of workloads, as a function of the window.
struct Curve {
    /// Where pieces begin, the first one at 0, each with what it is there.
    pieces: Vec<(u64, Piece)>,
}

/// Makes a front with sums.
pub(super) fn front(set: &Set<'_>) -> Box<dyn Front> {
    let longest = set.tasks.iter().map(|task| task.length_ns()).max();
    let until = set.tasks.iter().map(|task| task.relative_deadline_ns());
    Box::new(Blocks {
        each: Vec::new(),
        blocks: Vec::new(),
        longest_ns: longest.unwrap_or(0),
        until_ns: until.max().unwrap_or(0),
        lengths_ns: 0,
        failed: None,
    })
}

impl Blocks {
    /// Returns the curves of one DAG and from where on it is settled, unless they are too long.
    fn curves(&self, other: &Other) -> Option<(u64, [Curve; 3])> {
        let settled_ns = other.settled_ns(self.longest_ns, self.until_ns)?;
        let curve = |at: &dyn Fn(u64) -> Piece| Curve::of(self.until_ns, at);
        let curves = [
            curve(&|window_ns| other.on_all_cores().at(window_ns))?,
            curve(&|window_ns| other.while_waiting(window_ns, usize::MAX))?,
            curve(&|window_ns| other.while_waiting(window_ns, 1))?,
        ];
        Some((settled_ns, curves))
    }
}

impl Front for Blocks {
    fn among(&self) -> Result<&dyn Above, usize> {
        self.failed.map_or(Ok(self), Err)
    }

    fn push(&mut self, set: &Set<'_>, dag: usize, response_ns: Option<u64>) {
        let Some(response_ns) = response_ns else {
            self.failed = Some(self.failed.map_or(dag, |first| first.min(dag)));
            return;
        };
        let other = set.other(dag, response_ns, None);
        let Some((settled_ns, curves)) = self.curves(&other) else {
            self.each.push(other);
            return;
        };
        self.lengths_ns += u128::from(set.tasks[dag].length_ns());
        let members = vec![other];
        let mut block = Block {
            members,
            settled_ns,
            curves,
        };
        let is_small = |last: &mut Block, size| last.members.len() <= size;
        while let Some(last) = self
            .blocks
            .pop_if(|last| is_small(last, block.members.len()))
        {
            block.join(last);
        }
        self.blocks.push(block);
    }
}

impl Above for Blocks {
    fn is_empty(&self) -> bool {
        self.each.is_empty() && self.blocks.is_empty()
    }

    fn least_waiting_ns(&self, cores: usize) -> u64 {
        let cores = cores as u128;
        let is_busy = self.lengths_ns > cores * u128::from(self.longest_ns);
        let waiting = if is_busy {
            self.lengths_ns.div_ceil(cores)
        } else {
            0
        };
        u64::try_from(waiting).unwrap_or(u64::MAX)
    }

    fn is_summed(&self, window_ns: u64) -> bool {
        let settled = |block: &Block| block.settled_ns <= window_ns;
        window_ns <= self.until_ns && self.blocks.iter().all(settled)
    }

    fn add_to(
        &self,
        times: (u64, u64),
        clip: Clip,
        cores: usize,
        by_sums: bool,
        [plain, clipped]: [&mut [Piece]; 2],
    ) {
        let members = self.blocks.iter().flat_map(|block| &block.members);
        let members = members.filter(|_| !by_sums);
        for other in self.each.iter().chain(members) {
            other.add_to(times, clip, cores, plain, clipped);
        }
        for block in self.blocks.iter().filter(|_| by_sums) {
            let [all, most, least] = [0, 1, 2].map(|curve| block.curves[curve].at(times.0));
            for (j, (plain, clipped)) in plain.iter_mut().zip(&mut *clipped).enumerate() {
                *plain = plain.and(if j == 0 { all } else { least });
                *clipped = clipped.and(if j == 0 { most } else { least });
            }
        }
    }

    fn on_all_cores(&self, window_ns: u64) -> Piece {
        self.blocks
            .iter()
            .fold(self.each.on_all_cores(window_ns), |sum, block| {
                sum.and(if window_ns <= self.until_ns {
                    block.curves[0].at(window_ns)
                } else {
                    block.members.on_all_cores(window_ns)
                })
            })
    }
}

impl Block {
    fn join(&mut self, other: Self) {
        self.members.extend(other.members);
        self.settled_ns = self.settled_ns.max(other.settled_ns);
        for (curve, other) in self.curves.iter_mut().zip(&other.curves) {
            *curve = curve.and(other);
        }
    }
}

impl Curve {
    /// Takes the pieces of a workload for windows up to a limit, unless they are too many.
    fn of(until_ns: u64, at: &dyn Fn(u64) -> Piece) -> Option<Self> {
        let mut pieces = Vec::new();
        let mut start = 0;
        while pieces.len() < MOST_PIECES {
            let piece = at(start);
            pieces.push((start, piece));
            let end = piece.span.and_then(|span| u64::try_from(span).ok());
            match end.and_then(|span| start.checked_add(span)) {
                Some(end) if end <= until_ns => start = end,
                _ => return Some(Self { pieces }),
            }
        }
        None
    }

    /// Returns the sum of two curves.
    fn and(&self, other: &Self) -> Self {
        let (one, two) = (&self.pieces, &other.pieces);
        let mut pieces = Vec::with_capacity(one.len() + two.len());
        let (mut first, mut second) = (0, 0);
        loop {
            let start = one[first].0.max(two[second].0);
            pieces.push((start, from(one[first], start).and(from(two[second], start))));
            let next = |pieces: &[(u64, Piece)], index: usize| {
                pieces.get(index + 1).map_or(u64::MAX, |piece| piece.0)
            };
            let ends = (next(one, first), next(two, second));
            if ends == (u64::MAX, u64::MAX) {
                return Self { pieces };
            }
            first += usize::from(ends.0 <= ends.1);
            second += usize::from(ends.1 <= ends.0);
        }
    }

    fn at(&self, window_ns: u64) -> Piece {
        let after = self.pieces.partition_point(|piece| piece.0 <= window_ns);
        from(self.pieces[after - 1], window_ns)
    }
}

/// Returns what is left of a piece from some window on.
fn from((start, piece): (u64, Piece), window_ns: u64) -> Piece {
    let past = u128::from(window_ns - start);
    Piece {
        value: piece.value + piece.slope * past,
        span: piece.span.map(|span| span - past),
        ..piece
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use crate::analysis::Task;
    use crate::analysis::set::Set;

    /// Draws DAGs, one above the other: many of like periods, some that are far shorter, some
    /// whose jobs may overlap.
    fn tasks(seed: u64) -> Vec<Task> {
        let mut state = seed;
        let mut within = |least: u64, most: u64| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            least + (state >> 33) % (most - least + 1)
        };
        let count = within(5, 50);
        let tasks = (0..count).map(|_| {
            let most = if within(0, 3) == 0 { 200 } else { 9 };
            let wcets: Vec<u64> = (0..within(1, 9)).map(|_| within(1, most)).collect();
            let mut edges = Vec::new();
            for to in 1..wcets.len() {
                edges.extend((0..to).filter(|_| within(0, 5) == 0).map(|from| (from, to)));
            }
            let volume: u64 = wcets.iter().sum();
            let period = 40 * count * within(5, 100) / 10;
            let period = period.max(volume);
            let period = if within(0, 29) == 0 {
                volume + 60
            } else {
                period
            };
            let deadline = if within(0, 9) == 0 {
                2 * period
            } else {
                period
            };
            Task::new(period, deadline, wcets, &edges).unwrap()
        });
        tasks.collect()
    }

    #[test]
    fn by_sums_and_one_by_one_the_bounds_are_the_same() {
        let (mut proven, mut failed) = (0, 0);
        for seed in 25..45 {
            let tasks = tasks(seed);
            let tasks: Vec<&Task> = tasks.iter().collect();
            for cores in [2, 4, 7] {
                let mut set = Set::new(&tasks, cores);
                set.front = Some(super::front);
                let mut order: Vec<usize> = (0..tasks.len()).collect();
                let by_sums = set.solve(&order, |other, dag| other < dag);
                // From the least urgent one up the DAGs are visited in rounds, without sums.
                order.reverse();
                let each = set.solve(&order, |other, dag| other < dag);
                assert_eq!(by_sums.responses, each.responses, "seed {seed}, {cores}");
                let bounds = by_sums.responses.iter();
                proven += bounds.clone().filter(|bound| bound.is_some()).count();
                failed += bounds.filter(|bound| bound.is_none()).count();
            }
        }
        assert!(proven > 500 && failed > 200, "{proven}, {failed}");
    }
}
