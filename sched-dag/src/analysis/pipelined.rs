//! Overlapping jobs, `R > T`: their equation, and its solution.
//!
//! Derived for this project. Related work (J. Fonseca, G. Nelissen, V. Nélis, Real-Time Systems 55,
//! 2019) covers arbitrary deadlines, but without the rule that a subtask is sequential over its own
//! jobs.
//!
//! The critical chain of a job ends with its last subtask. It goes back through the last thing each
//! subtask waited for: a predecessor, or the same subtask of the job before. Say the chain starts
//! with the release of the job `j` places earlier. The chain has at most
//! `P_j = length + j * largest WCET` of work, and whenever it waits, all `m` cores run something
//! else. So the job's last finish, counted from the chain's release, is at most the least `X` with
//!
//! `X = P_j + ((j + 1) volume - P_j + own + blocking + sum of W_i(X)) / m`
//!
//! and the response time is `R = max over j of X_j - j T`. The chain itself limits `j`: it goes
//! back over `j` releases only if its part over `j - 1` of them can last until the next release,
//! `X_(j-1) > j T`.
//!
//! The terms: `W_i` is the [`InterferingWorkload`](super::workload::InterferingWorkload) of each
//! DAG that may outrank this DAG. `own` is the work of still older jobs in the window,
//! `sum over l >= 1, l T < R of min(volume, p (R - l T))`, twice as much if younger jobs may win
//! over older jobs. `blocking` is lower-ranked work that cannot be preempted. The right side also
//! contains the time lost by all `m` cores to long steps (`bursts`). While `X_0 <= T` only `j = 0`
//! is left and `own` is 0: this is the equation of Melani et al. 2015, and `multi_path` has better
//! equations.
//!
//! Traps, both found in an earlier form:
//!
//! 1. Following the chain back only over the jobs that the job itself can meet (`j T < R`). But
//!    each job may delay only the next, and a delay may still be handed on forever: a subtask with
//!    a WCET of one period never catches up. In the test `delays_that_are_handed_on_count` this
//!    mistake would claim 18, while observed response times grow without end.
//! 2. Assuming that another DAG uses no more cores than one of its jobs can, even when its jobs
//!    overlap. In the test `overlapping_jobs_take_more_cores` this mistake would claim 8, while 9
//!    is observed.
//!
//! The least solution is found exactly, from below. Both sides are piecewise linear. Creeping up by
//! the difference might advance one nanosecond a step, so each step solves the present linear piece
//! or jumps to its end; see [`WorkloadSegment`].

use alloc::vec::Vec;

use super::interference::{DelaySources, GraphSummary, on_all_cores};
use super::task::Task;
use super::workload::WorkloadSegment;

/// The most evaluations of equations' right-hand sides, shared by the DAGs of one analysis. A DAG
/// that needs more is "not proven".
pub(super) const STEP_LIMIT: u64 = 200_000;

/// Further evaluations for each DAG alone, besides the shared evaluations. Ordinary sets need tens.
pub(super) const OWN_STEPS: u64 = 256;

/// The most jobs of one DAG over which a window may reach back. A set that needs more
/// (`R > 1024 T`) is "not proven".
const OVERLAP_LIMIT: u64 = 1024;

/// The terms of a task in its equation.
#[derive(Clone, Debug)]
pub(super) struct PipelineTerms {
    period: u128,
    deadline: u128,
    volume: u128,
    /// The part of the volume that may delay the chain in its last job.
    last_volume: u128,
    length: u128,
    largest: u128,
    cores: usize,
    /// The most cores one job can use, at most `cores`.
    parallelism: u128,
    /// The response-time bound of all jobs, if already known.
    whole: Option<u128>,
    /// Whether a younger job's subtask may win over an older job's.
    pub(super) younger_may_win: bool,
}

/// Why an equation has no usable solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SolverFailure {
    /// The least solution, if any, exceeds the relative deadline.
    BeyondDeadline,
    /// A limit on steps, on overlapping jobs or on the numbers' size was hit.
    Limit,
}

impl PipelineTerms {
    /// Takes the figures of a task on `cores >= 1` cores: preemptive, older jobs first.
    pub(super) fn of(task: &Task, cores: usize, shape: &GraphSummary) -> Self {
        Self {
            period: task.period_ns().into(),
            deadline: task.relative_deadline_ns().into(),
            volume: task.volume_ns().into(),
            last_volume: task.volume_ns().into(),
            length: task.length_ns().into(),
            largest: shape.largest_ns.first().copied().unwrap_or(0).into(),
            cores,
            parallelism: shape.parallelism.into(),
            whole: None,
            younger_may_win: false,
        }
    }

    /// Returns the figures of one sink of the task: the longest path to the sink, the part of its
    /// own job that may delay it, its deadline, and the bound of all jobs of the task.
    pub(super) fn of_sink(
        &self,
        length_ns: u64,
        volume_ns: u64,
        deadline_ns: u64,
        whole_ns: u64,
    ) -> Self {
        Self {
            deadline: self.deadline.min(deadline_ns.into()),
            last_volume: volume_ns.into(),
            length: length_ns.into(),
            whole: Some(whole_ns.into()),
            ..self.clone()
        }
    }

    /// Accepts no response time beyond `jobs` periods: one more job in flight would meet the
    /// overrun policy.
    pub(super) fn allow_in_flight(&mut self, jobs: u32) {
        self.deadline = self.deadline.min(u128::from(jobs) * self.period);
    }

    /// Returns the longest useful response time in nanoseconds.
    pub(super) fn limit_ns(&self) -> u64 {
        u64::try_from(self.deadline).unwrap_or(u64::MAX)
    }

    /// Returns the least response-time bound of at least `start_ns`; `start_ns` must not exceed the
    /// least solution (0 is always right).
    pub(super) fn solve(
        &self,
        delays: &DelaySources,
        start_ns: u64,
        steps: &mut u64,
    ) -> Result<u64, SolverFailure> {
        let mut response = u128::from(start_ns);
        let mut windows: Vec<u128> = Vec::new();
        loop {
            // Windows only grow with the response, so each search goes on from the last result.
            self.extend(&mut windows, response, delays, steps)?;
            let back = windows.iter().zip(0..);
            let responses = back.map(|(window, back)| window.saturating_sub(back * self.period));
            let largest = responses.max().unwrap_or(0).max(response);
            if largest == response {
                return u64::try_from(response).map_err(|_| SolverFailure::BeyondDeadline);
            }
            response = largest;
        }
    }

    /// Returns the windows `X_0`, `X_1`, .. of a response time known as a solution, and the most
    /// work of jobs before the chain's first.
    pub(super) fn windows(
        &self,
        delays: &DelaySources,
        response_ns: u64,
    ) -> Result<(Vec<u128>, u128), SolverFailure> {
        let (mut windows, mut steps) = (Vec::new(), STEP_LIMIT);
        let response = u128::from(response_ns);
        self.extend(&mut windows, response, delays, &mut steps)?;
        let own = self.other_jobs(self.whole.unwrap_or(response))?;
        Ok((windows, own))
    }

    /// Raises the windows to the windows of a response time.
    fn extend(
        &self,
        windows: &mut Vec<u128>,
        response: u128,
        delays: &DelaySources,
        steps: &mut u64,
    ) -> Result<(), SolverFailure> {
        let own = self.other_jobs(self.whole.unwrap_or(response))?;
        for back in 0..=OVERLAP_LIMIT {
            let index = usize::try_from(back).map_err(|_| SolverFailure::Limit)?;
            if index == windows.len() {
                windows.push(0);
            }
            windows[index] = self.window(back, own, delays, windows[index], steps)?;
            if windows[index] <= u128::from(back + 1) * self.period {
                return Ok(());
            }
        }
        Err(SolverFailure::Limit)
    }

    /// Returns the most work, during the chain, of jobs before the chain's first (and of jobs after
    /// the job itself, if they may win).
    fn other_jobs(&self, response: u128) -> Result<u128, SolverFailure> {
        let mut sum = 0;
        let mut left = response;
        for _ in 0..OVERLAP_LIMIT {
            match left.checked_sub(self.period) {
                None | Some(0) => {
                    // Younger jobs overlap the chain at its end, as older jobs do at its beginning.
                    let sides = if self.younger_may_win { 2 } else { 1 };
                    return Ok(sides * sum);
                }
                Some(rest) => {
                    sum += self.volume.min(self.parallelism * rest);
                    left = rest;
                }
            }
        }
        Err(SolverFailure::Limit)
    }

    /// Returns the least `X_j`, starting from a value not above it.
    fn window(
        &self,
        back: u64,
        own: u128,
        delays: &DelaySources,
        start: u128,
        steps: &mut u64,
    ) -> Result<u128, SolverFailure> {
        let back = u128::from(back);
        let limit = self.deadline + back * self.period;
        let cores = self.cores as u128;
        let mut window = start.max(self.chain(back));
        while window <= limit {
            *steps = steps.checked_sub(1).ok_or(SolverFailure::Limit)?;
            let length = u64::try_from(window).map_err(|_| SolverFailure::Limit)?;
            let busy = self.busy(back, own, delays, length);
            match busy.lacks(cores, window - self.chain(back)) {
                None => return Ok(window),
                Some(lack) => window = window.checked_add(lack).ok_or(SolverFailure::Limit)?,
            }
        }
        Err(SolverFailure::BeyondDeadline)
    }

    /// Returns `P_j`.
    fn chain(&self, back: u128) -> u128 {
        self.length + back * self.largest
    }

    /// Returns the most work on the cores while a chain over `back` releases waits.
    pub(super) fn busy(
        &self,
        back: u128,
        own: u128,
        delays: &DelaySources,
        window_ns: u64,
    ) -> WorkloadSegment {
        let constant = (back * self.volume + self.last_volume - self.chain(back))
            .saturating_add(own)
            .saturating_add(delays.blocking.along_a_chain(self.cores, back));
        let sum = on_all_cores(&delays.others, window_ns);
        let sum = sum.and(delays.bursts.on(self.cores, window_ns));
        let value = sum.value.saturating_add(constant);
        WorkloadSegment { value, ..sum }
    }
}

#[cfg(test)]
mod tests {
    use crate::analysis::{InterferenceBound, Task, multi_path_fp};

    #[test]
    fn e8_two_pipelines() {
        let chain = Task::new(10, 30, vec![4, 5, 3], &[(0, 1), (1, 2)]).unwrap();
        let diamond = [(0, 1), (0, 2), (1, 3), (2, 3)];
        let other = Task::new(25, 50, vec![1, 3, 3, 1], &diamond).unwrap();
        let bounds = multi_path_fp(&[&chain, &other], 3, InterferenceBound::Window);
        assert_eq!(bounds, Some(vec![13, 14]));
    }
}
