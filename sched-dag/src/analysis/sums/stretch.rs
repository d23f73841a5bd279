//! The sums of a stretch, as curves: those of one DAG, those of two stretches, and what they tell.

use super::Tree;
use super::curve::Curve;
use crate::analysis::set::Set;
use crate::analysis::workload::{Piece, Workload};

/// How many curves of one argument there are: all, clipped to its chains, and that on half of the
/// cores and on one.
pub(super) const CURVES: usize = 4;

/// What is added up of some DAGs.
pub(super) struct Sums {
    /// From this window on they are settled.
    pub(super) settled_ns: u64,
    /// The last of their deadlines.
    latest_ns: u64,
    /// The first, if each is sooner by what a part of the DAG can take at most.
    earliest_ns: i128,
    pub(super) longest_ns: u64,
    lengths_ns: u128,
    by_window: [Curve; CURVES],
    by_deadline: [Curve; CURVES],
    /// What of the lengths counts for a deadline.
    due: Curve,
}

/// Which curves tell.
#[derive(Clone, Copy)]
pub(super) enum By {
    /// Those by the window, for so many more nanoseconds.
    Window(u64),
    Deadline(u64),
}

impl Sums {
    /// Returns the curves of one DAG, unless they are too long or it is never settled.
    pub(super) fn of(tree: &Tree, set: &Set<'_>, dag: usize, response_ns: u64) -> Option<Self> {
        let task = set.tasks[dag];
        let other = set.other(dag, response_ns, None);
        let (length_ns, own_ns) = (task.length_ns(), task.least_deadline_ns());
        let curve = |at: &dyn Fn(u64) -> Piece| Curve::of(tree.until_ns, at);
        let clipped = |cores, part: &dyn Fn(&Workload, u64) -> Piece| {
            curve(&|at| other.unclipped(cores, |workload| part(workload, at)))
        };
        let curves = |part: &dyn Fn(&Workload, u64) -> Piece| -> Option<[Curve; CURVES]> {
            Some([
                curve(&|at| part(other.on_all_cores(), at))?,
                clipped(usize::MAX, part)?,
                clipped(half(set.cores as usize), part)?,
                clipped(1, part)?,
            ])
        };
        let (by_deadline, due) = if tree.deadlines_limit {
            let chain = Workload::new(task, length_ns, response_ns, 1, 1);
            let one_job = Piece {
                value: length_ns.into(),
                ..Piece::NONE
            };
            (
                curves(&|part, at| part.due(own_ns, at))?,
                curve(&|at| chain.due(own_ns, at).least(one_job))?,
            )
        } else {
            ([(); CURVES].map(|()| Curve::none()), Curve::none())
        };
        Some(Self {
            settled_ns: other.settled_ns(tree.longest_ns, tree.until_ns)?,
            latest_ns: own_ns,
            earliest_ns: i128::from(own_ns) - i128::from(task.volume_ns().min(response_ns)),
            longest_ns: length_ns,
            lengths_ns: length_ns.into(),
            by_window: curves(&|part, at| part.at(at))?,
            by_deadline,
            due,
        })
    }

    /// Returns the sums of two stretches.
    pub(super) fn and(&self, other: &Self) -> Self {
        let curves = |of: fn(&Self) -> &[Curve; CURVES]| {
            [0, 1, 2, 3].map(|curve| of(self)[curve].and(&of(other)[curve]))
        };
        Self {
            settled_ns: self.settled_ns.max(other.settled_ns),
            latest_ns: self.latest_ns.max(other.latest_ns),
            earliest_ns: self.earliest_ns.min(other.earliest_ns),
            longest_ns: self.longest_ns.max(other.longest_ns),
            lengths_ns: self.lengths_ns + other.lengths_ns,
            by_window: curves(|sums| &sums.by_window),
            by_deadline: curves(|sums| &sums.by_deadline),
            due: self.due.and(&other.due),
        }
    }

    /// Returns which curves of a tree tell about a window, if any do; where there is a limit, of
    /// jobs that are due by then.
    pub(super) fn by(&self, tree: &Tree, limit_ns: Option<u64>, window_ns: u64) -> Option<By> {
        let until_ns = tree.until_ns.checked_sub(window_ns)?;
        let Some(limit_ns) = limit_ns else {
            return Some(By::Window(until_ns + 1));
        };
        if let Some(before_ns) = limit_ns.checked_sub(window_ns)
            && let Some(room_ns) = before_ns.checked_sub(self.latest_ns)
        {
            return Some(By::Window(room_ns));
        }
        let is_later = i128::from(limit_ns) <= self.earliest_ns + i128::from(window_ns);
        // A window that is settled has room for what the deadline leaves.
        (is_later && self.settled_ns <= window_ns).then_some(By::Deadline(limit_ns))
    }

    /// Returns what a curve tells about a window.
    pub(super) fn at(&self, by: By, curve: usize, window_ns: u64) -> Piece {
        match by {
            By::Window(span_ns) => self.by_window[curve].at(window_ns).up_to(span_ns),
            By::Deadline(limit_ns) => Piece {
                value: self.by_deadline[curve].at(limit_ns).value,
                ..Piece::NONE
            },
        }
    }

    /// Returns the sum of the lengths, as far as they count.
    pub(super) fn lengths_ns(&self, limit_ns: Option<u64>) -> u128 {
        limit_ns.map_or(self.lengths_ns, |limit_ns| self.due.at(limit_ns).value)
    }
}

/// Returns half of the cores, rounded up.
pub(super) const fn half(cores: usize) -> usize {
    cores.div_ceil(2)
}
