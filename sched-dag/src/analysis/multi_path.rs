//! The multi-path bound: one job of a DAG at a time, alone or among others.
//!
//! Statement, proof and what was checked are in `docs/multi-path-bound.md`; here in short. Let
//! `C_j` be the most work of `j + 1` disjoint chains of the DAG (see `cover`), and
//! `B_j = volume - C_j`. Look at a job at any instant at which its longest remaining path
//! does not shrink. Then a ready subtask waits, so all `m` cores are busy, and the
//! remaining `j + 1` heaviest chains run on at most `j` of them. Such instants sum up to
//! `x = r - length` if the job is not complete at `r`; so it is, if for some `j < m`
//!
//! - `(m - j) x >= B_j + blocking + sum of W_i(r)`, or
//! - `(m - j) x >= max(1, B_j) + blocking + sum of W_i(r)`, each `W_i` clipped to what DAG `i`
//!   can execute in `x`: on each of its cores, and of each of its chains.
//!
//! `W_i` counts at most `m - j` cores. With `j = 0` the first form is that of Melani et al.
//! 2015, without others Graham's; with chains of greedy long paths it is that of He et al.
//! 2022. So none of these can be better, but for the rounding: here divisions round up,
//! since preemptions need not be at whole nanoseconds.
//!
//! Where long steps may keep cores (bursts, in `workload`), `m - j` times that is added to the right side.
//!
//! Assumes: no core idles while a subtask is ready; `R <= T`, that is one job of the DAG at
//! a time, which each solution is limited to. Any order inside the DAG.
//!
//! Trap: without `max(1, ..)` the second form "proves" `r = length` whenever `B_j = 0`: the
//! clip then counts nothing.

use alloc::vec;

use super::cover::covers;
use super::interference::{DelaySources, InterferenceBound};
use super::pipelined::SolverFailure;
use super::task::Task;
use super::workload::WorkloadSegment;

/// Bounds the response time of one job alone on `cores` cores; `None` without cores.
#[must_use]
pub fn multi_path(task: &Task, cores: u32) -> Option<u64> {
    let most = usize::try_from(cores).ok()?;
    alone(task, &covers(task, most), cores.into())
}

/// Bounds the response time of one job alone, with covers at hand.
pub(super) fn alone(task: &Task, covers: &[u64], cores: u64) -> Option<u64> {
    let left = (0..cores).zip(covers);
    let left = left.map(|(j, cover)| (task.volume_ns() - cover).div_ceil(cores - j));
    // A DAG without subtasks has no chain, and takes no time.
    let waiting = left.min().or((cores > 0).then_some(0))?;
    Some(task.length_ns() + waiting)
}

/// The terms of one DAG in its equations, with `j` from 0 to one less than the covers.
pub(super) struct MultiPathEquations<'a> {
    pub(super) task: &'a Task,
    pub(super) covers: &'a [u64],
    pub(super) cores: usize,
    pub(super) clip: InterferenceBound,
    /// The longest response time that is of use, at most a period.
    pub(super) limit_ns: u64,
}

/// One of the inequalities: proven if `cores` times the waiting is at least `busy`.
#[derive(Clone, Copy, Debug)]
pub(super) struct WaitInequality {
    /// The cores that count: `m - j`.
    pub(super) cores: u128,
    pub(super) is_clipped: bool,
    pub(super) busy: WorkloadSegment,
}

impl MultiPathEquations<'_> {
    /// Returns the least response time that some form proves, if it is at least `start_ns`.
    pub(super) fn solve(
        &self,
        delays: &DelaySources,
        start_ns: u64,
        steps: &mut u64,
    ) -> Result<u64, SolverFailure> {
        let start = alone(self.task, self.covers, self.cores as u64);
        let length = self.task.length_ns();
        let mut window = start_ns.max(start.unwrap_or(0)).max(length);
        while window <= self.limit_ns {
            *steps = steps.checked_sub(1).ok_or(SolverFailure::Limit)?;
            let waiting = u128::from(window - length);
            let forms = self.forms(delays, window);
            let lacks = forms.map(|form| form.busy.lacks(form.cores, waiting));
            // Without subtasks there are no forms, and nothing to wait for.
            let Some(lack) = lacks.min().flatten() else {
                return Ok(window);
            };
            let after = u64::try_from(u128::from(window).saturating_add(lack));
            window = after.map_err(|_| SolverFailure::BeyondDeadline)?;
        }
        Err(SolverFailure::BeyondDeadline)
    }

    /// Returns the forms at a window of at least the length.
    pub(super) fn forms(
        &self,
        delays: &DelaySources,
        window_ns: u64,
    ) -> impl Iterator<Item = WaitInequality> {
        let DelaySources {
            others,
            blocking,
            bursts,
        } = delays;
        let times = (window_ns, window_ns - self.task.length_ns());
        let mut plain = vec![WorkloadSegment::NONE; self.covers.len()];
        let mut clipped = plain.clone();
        for other in others {
            other.add_to(times, self.clip, self.cores, &mut plain, &mut clipped);
        }
        // Alone, or without a clip, both forms are one.
        let has_clipped = !others.is_empty() && self.clip != InterferenceBound::Window;
        let sums = plain.into_iter().zip(clipped).enumerate();
        sums.flat_map(move |(j, (plain, clipped))| {
            let left = u128::from(self.task.volume_ns() - self.covers[j]);
            let form = |is_clipped: bool, own: u128, sum: WorkloadSegment| {
                let blocked = blocking.during(self.cores, j, is_clipped);
                let sum = sum.and(bursts.on(self.cores - j, window_ns));
                let value = sum.value.saturating_add(own).saturating_add(blocked);
                WaitInequality {
                    cores: (self.cores - j) as u128,
                    is_clipped,
                    busy: WorkloadSegment { value, ..sum },
                }
            };
            let clipped = has_clipped.then(|| form(true, left.max(1), clipped));
            core::iter::once(form(false, left, plain)).chain(clipped)
        })
    }
}
