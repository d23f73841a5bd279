//! The equation that all response-time tests here share, and its solution.
//!
//! The critical chain of a job ends with its last subtask and goes back through
//! what each subtask waited for last: a predecessor, or the same subtask of the
//! job before. Say it starts with the release of the job `j` places earlier.
//! It has at most `P_j = length + j * largest WCET` of its own, and whenever it
//! waits, all `m` cores run something else. So the job's last finish, counted
//! from that release, is at most the least `X` with
//!
//! `X = P_j + ((j + 1) volume - P_j + own + blocking + sum of W_i(X)) / m`
//!
//! and the response time is `R = max over j of X_j - j T`. Which `j` can occur
//! follows from the chain: it goes back over `j` releases only if its part over
//! `j - 1` of them can last until the next release, `X_(j-1) > j T`.
//!
//! The terms: `W_i`, the [`Workload`] of each DAG that may outrank this one;
//! `own`, what still older jobs may run in the window,
//! `sum over l >= 1, l T < R of min(volume, p (R - l T))`, twice that if
//! younger jobs may win over older ones; `blocking`, lower-ranked work that
//! cannot be preempted. While `X_0 <= T` only `j = 0` is left and `own` is 0:
//! then this is the equation of Melani et al. 2015.
//!
//! The least solution is found exactly, from below. Both sides are piecewise
//! linear, so instead of creeping up by the difference, which may be one
//! nanosecond a step, each step solves the present linear piece or jumps to
//! its end; see [`Piece`](super::workload::Piece).

use alloc::vec::Vec;

use super::task::Task;
use super::workload::Workload;

/// The most evaluations of an equation's right-hand side in one analysis; a
/// set that needs more is "not proven". Ordinary sets need tens.
pub(super) const STEP_LIMIT: u64 = 200_000;

/// The most jobs of one DAG that a window may reach back over; a set that
/// needs more (`R > 1024 T`) is "not proven".
const OVERLAP_LIMIT: u64 = 1024;

/// What of a task enters its equation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Figures {
    period: u128,
    deadline: u128,
    volume: u128,
    length: u128,
    largest: u128,
    cores: u128,
    /// The most cores that one job can use, at most `cores`.
    parallelism: u128,
    /// Whether a younger job's subtask may win over an older job's.
    pub(super) younger_may_win: bool,
    /// Non-preemptible work of lower rank, all zero if there is none.
    pub(super) blocking: Blocking,
}

/// Lower-ranked work that a chain may find on the cores and must wait for.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Blocking {
    /// When the chain's first subtask becomes ready.
    pub(super) first: u128,
    /// When each later one becomes ready.
    pub(super) later: u128,
    /// The most subtasks on a path, at least 1 if anything blocks.
    pub(super) chain: u128,
}

/// Why an equation has no usable solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unsolved {
    /// The least solution, if any, exceeds the relative deadline.
    BeyondDeadline,
    /// A limit on steps, on overlapping jobs or on the numbers' size was hit.
    Limit,
}

impl Figures {
    /// Takes the figures of a task on `cores >= 1` cores, with a job on at
    /// most `parallelism` of them: preemptive, older jobs first.
    pub(super) fn of(task: &Task, cores: u64, parallelism: u64) -> Self {
        Self {
            period: task.period_ns().into(),
            deadline: task.relative_deadline_ns().into(),
            volume: task.volume_ns().into(),
            length: task.length_ns().into(),
            largest: task.largest_wcet_ns().into(),
            cores: cores.into(),
            parallelism: parallelism.into(),
            younger_may_win: false,
            blocking: Blocking::default(),
        }
    }

    /// Accepts no response time beyond this number of periods: one more job would meet
    /// the overrun policy.
    pub(super) fn allow_in_flight(&mut self, jobs: u32) {
        self.deadline = self.deadline.min(u128::from(jobs) * self.period);
    }

    /// Returns the least response-time bound that is at least `start_ns`, which
    /// must not exceed the least solution (0 always is right).
    pub(super) fn solve(
        &self,
        interference: &[Workload],
        start_ns: u64,
        steps: &mut u64,
    ) -> Result<u64, Unsolved> {
        let mut response = u128::from(start_ns);
        let mut windows: Vec<u128> = Vec::new();
        loop {
            let own = self.other_jobs(response)?;
            let mut largest = response;
            let mut back = 0;
            loop {
                let index = usize::try_from(back).map_err(|_| Unsolved::Limit)?;
                if index == windows.len() {
                    windows.push(0);
                }
                let window = self.window(back, own, interference, windows[index], steps)?;
                windows[index] = window;
                let offset = u128::from(back) * self.period;
                largest = largest.max(window.saturating_sub(offset));
                if window <= offset + self.period {
                    break;
                }
                back += 1;
                if back > OVERLAP_LIMIT {
                    return Err(Unsolved::Limit);
                }
            }
            if largest == response {
                return u64::try_from(response).map_err(|_| Unsolved::BeyondDeadline);
            }
            response = largest;
        }
    }

    /// Returns what jobs before the chain's first (and after the job itself,
    /// if they may win) can run while the chain lasts.
    fn other_jobs(&self, response: u128) -> Result<u128, Unsolved> {
        let mut sum = 0;
        let mut left = response;
        for _ in 0..OVERLAP_LIMIT {
            match left.checked_sub(self.period) {
                None | Some(0) => {
                    let sides = if self.younger_may_win { 2 } else { 1 };
                    return Ok(sides * sum);
                }
                Some(rest) => {
                    sum += self.volume.min(self.parallelism * rest);
                    left = rest;
                }
            }
        }
        Err(Unsolved::Limit)
    }

    /// Returns the least `X_j`, starting from a value not above it.
    fn window(
        &self,
        back: u64,
        own: u128,
        interference: &[Workload],
        start: u128,
        steps: &mut u64,
    ) -> Result<u128, Unsolved> {
        let back = u128::from(back);
        let chain = self.length + back * self.largest;
        let limit = self.deadline + back * self.period;
        let Blocking { first, later, .. } = self.blocking;
        let repeats = (self.blocking.chain + back).saturating_sub(1);
        let constant = (back + 1) * self.volume - chain
            + own
            + first
            + later.checked_mul(repeats).ok_or(Unsolved::Limit)?;
        let mut window = start.max(chain + constant / self.cores);
        loop {
            if window > limit {
                return Err(Unsolved::BeyondDeadline);
            }
            *steps = steps.checked_sub(1).ok_or(Unsolved::Limit)?;
            let (mut busy, mut slope, mut span) = (constant, 0_u128, u128::MAX);
            let length = u64::try_from(window).map_err(|_| Unsolved::Limit)?;
            for workload in interference {
                let piece = workload.at(length);
                busy = busy.checked_add(piece.value).ok_or(Unsolved::Limit)?;
                slope += piece.slope;
                span = span.min(piece.span.unwrap_or(u128::MAX));
            }
            let next = chain + busy / self.cores;
            if next <= window {
                return Ok(window);
            }
            window = next.max(window + self.jump(busy, chain, window, slope, span));
        }
    }

    /// Returns how far the least solution of the linear piece
    /// `m (x - chain) = busy + slope (x - window)` lies ahead, at most `span`.
    fn jump(&self, busy: u128, chain: u128, window: u128, slope: u128, span: u128) -> u128 {
        match self.cores.checked_sub(slope) {
            None | Some(0) => span,
            Some(gap) => {
                // chain + floor(busy / m) > window >= chain: not below 0.
                let over = busy - self.cores * (window + 1 - chain);
                span.min(over / gap + 1)
            }
        }
    }
}
