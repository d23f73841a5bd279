//! The multi-path bound: one job of a DAG at a time, alone or among others.
//!
//! `docs/bounds.md` has the statement, the proof and the checks; this is a summary. Let `C_j` be
//! the most work of `j + 1` disjoint chains of the DAG (see `cover`), and `B_j = volume - C_j`.
//! Look at any instant of a job at which its longest remaining path does not shrink. At such an
//! instant a ready subtask waits, so all `m` cores are busy, and the remaining `j + 1` heaviest
//! chains run on at most `j` of them. If the job is not complete at `r`, such instants sum up to
//! `x = r - length`. So the job is complete at `r` if for some `j < m`
//!
//! - `(m - j) x >= B_j + blocking + sum of W_i(r)`, or
//! - `(m - j) x >= max(1, B_j) + blocking + sum of W_i(r)`, each `W_i` clipped to the work DAG `i`
//!   can execute in `x`: on each of its cores, and of each of its chains.
//!
//! `W_i` counts at most `m - j` cores. With `j = 0` the first form is the form of Melani et al.
//! 2015, and without other DAGs Graham's. With chains of greedy long paths it is the form of He et
//! al. 2022. So none of those can be better, except for the rounding: here divisions round up,
//! since preemptions need not happen at whole nanoseconds.
//!
//! Where long steps may keep cores (bursts, in `workload`), `m - j` times the lost time is added to
//! the right side.
//!
//! Assumes: no core idles while a subtask is ready; `R <= T`, that is, one job of the DAG at a time
//! (each solution is limited to `T`). Any order inside the DAG.
//!
//! Trap: without `max(1, ..)` the second form "proves" `r = length` whenever `B_j = 0`, because the
//! clip then counts nothing.

use alloc::vec;

use super::cover::covers;
use super::interference::{DelaySources, InterferenceBound};
use super::pipelined::SolverFailure;
use super::task::Task;
use super::waiting::{Rounding, beside_span};
use super::workload::WorkloadSegment;
use crate::ids::to_u32;

/// Bounds the response time of one job alone on `cores` cores; `None` without cores.
pub fn multi_path(task: &Task, cores: u32) -> Option<u64> {
    let most = usize::try_from(cores).ok()?;
    let covers = covers(task.oblivious(), most);
    alone(
        task,
        &beside_span(task, &covers, cores),
        cores,
        Rounding::Up,
    )
}

/// Bounds the response time of one job alone by the work left beside its span.
pub(super) fn alone(task: &Task, left: &[u64], cores: u32, rounding: Rounding) -> Option<u64> {
    let cores = u64::from(cores);
    let left = (0..cores).zip(left);
    let left = left.map(|(j, &left)| rounding.divide(left, cores - j));
    // A DAG without subtasks has no chain and takes no time.
    let waiting = left.min().or((cores > 0).then_some(0))?;
    task.span_ns().checked_add(waiting)
}

/// The terms of one DAG in its equations.
pub(super) struct MultiPathEquations<'a> {
    pub(super) task: &'a Task,
    /// As in the DAG's [`GraphSummary`](super::interference::GraphSummary).
    pub(super) covers: &'a [u64],
    pub(super) left: &'a [u64],
    pub(super) cores: usize,
    pub(super) clip: InterferenceBound,
    pub(super) rounding: Rounding,
    /// The longest useful response time in nanoseconds, at most a period.
    pub(super) limit_ns: u64,
}

/// One of the inequalities: proven if `cores` times the waiting time is at least `busy`.
#[derive(Clone, Copy, Debug)]
pub(super) struct WaitInequality {
    /// The number of cores counted: `m - j`.
    pub(super) cores: u128,
    pub(super) is_clipped: bool,
    pub(super) busy: WorkloadSegment,
}

impl MultiPathEquations<'_> {
    /// Returns the least response time of at least `start_ns` proven by some form.
    pub(super) fn solve(
        &self,
        delays: &DelaySources,
        start_ns: u64,
        steps: &mut u64,
    ) -> Result<u64, SolverFailure> {
        let start = alone(self.task, self.left, to_u32(self.cores), self.rounding);
        let span = self.task.span_ns();
        let mut window = start_ns.max(start.unwrap_or(0)).max(span);
        while window <= self.limit_ns {
            *steps = steps.checked_sub(1).ok_or(SolverFailure::Limit)?;
            let forms = self.forms(delays, window);
            let lacks = forms.map(|form| self.lacks(delays, window, &form));
            // Without subtasks there are no forms, and nothing to wait for.
            let Some(lack) = lacks.min().flatten() else {
                return Ok(window);
            };
            let after = u64::try_from(u128::from(window).saturating_add(lack));
            window = after.map_err(|_| SolverFailure::BeyondDeadline)?;
        }
        Err(SolverFailure::BeyondDeadline)
    }

    /// Returns how much longer a window of at least the span must be before a form may be
    /// satisfied; `None`: the form is satisfied.
    pub(super) fn lacks(
        &self,
        delays: &DelaySources,
        window_ns: u64,
        form: &WaitInequality,
    ) -> Option<u128> {
        let waiting_ns = window_ns - self.task.span_ns();
        let (cores, waiting) = (form.cores, u128::from(waiting_ns));
        let published = form.busy.lacks(cores, waiting);
        if self.clip != InterferenceBound::Sharp || !form.is_clipped || published.is_none() {
            return published;
        }
        let count = usize::try_from(cores).unwrap_or(self.cores);
        let others = delays.others.iter();
        let others = others.map(|other| other.ahead((window_ns, waiting_ns), count));
        let ahead = others.fold(WorkloadSegment::NONE, WorkloadSegment::and);
        let (cover, value) = (self.covers.get(self.cores - count), ahead.value);
        if cover != Some(&self.task.oblivious().volume_ns()) || form.busy.value != value + 1 {
            return published;
        }
        // Workloads are no smaller in a longer window. The job may wait longer as long as they grow
        // with the waiting, in this window, no slower than the cores execute.
        let is_steep = ahead.slope >= cores;
        let steep = is_steep.then(|| ahead.span.map_or(u128::MAX, |span| span.max(1)));
        let busy = WorkloadSegment { value, ..form.busy };
        let beyond = ahead.lacks(cores, waiting).or(steep);
        beyond.max(busy.lacks(cores, waiting))
    }

    /// Returns the forms for a window of at least the span.
    pub(super) fn forms(
        &self,
        delays: &DelaySources,
        window_ns: u64,
    ) -> impl Iterator<Item = WaitInequality> {
        let DelaySources {
            others,
            blocking,
            left_and_blocking,
            bursts,
        } = delays;
        let oblivious = self.task.oblivious();
        let times = (window_ns, window_ns - oblivious.length_ns());
        let mut plain = vec![WorkloadSegment::NONE; self.left.len()];
        let mut clipped = plain.clone();
        for other in others {
            other.add_to(times, self.clip, self.cores, &mut plain, &mut clipped);
        }
        // Alone, or without a clip, both forms are the same.
        let has_clipped = !others.is_empty() && self.clip != InterferenceBound::Window;
        let form = move |j: usize, is_clipped: bool, own: u128, sum: WorkloadSegment| {
            let sum = sum.and(bursts.on(self.cores - j, window_ns));
            let (cores, value) = ((self.cores - j) as u128, sum.value.saturating_add(own));
            let value = match is_clipped {
                true => value,
                false => self.rounding.of(value, cores),
            };
            WaitInequality {
                cores,
                is_clipped,
                busy: WorkloadSegment { value, ..sum },
            }
        };
        // With waits and blocking together, only the first form with `j = 0` is proven.
        let count = left_and_blocking.map_or(self.left.len(), |_| 1);
        let sums = plain.into_iter().zip(clipped).enumerate().take(count);
        sums.flat_map(move |(j, (plain, clipped))| {
            let with_blocking = |own: u128, is_clipped| {
                own.saturating_add(blocking.during(self.cores, j, is_clipped))
            };
            let left = || with_blocking(self.left[j].into(), false);
            let first = form(j, false, left_and_blocking.unwrap_or_else(left), plain);
            let cover = self.covers.get(j).filter(|_| has_clipped);
            let clipped = cover.filter(|_| left_and_blocking.is_none()).map(|cover| {
                let left = u128::from(oblivious.volume_ns() - cover).max(1);
                form(j, true, with_blocking(left, true), clipped)
            });
            core::iter::once(first).chain(clipped)
        })
    }
}
