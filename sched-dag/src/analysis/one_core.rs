//! One core: exact response times under static priorities, and the demand test under EDF.
//!
//! On one core a job's inner order does not matter: while the job is unfinished, one of its
//! subtasks is ready, so the core is busy, and the job needs its volume whatever is taken
//! first. So the tests for sequential jobs hold, with volumes for WCETs.
//!
//! *Static priorities* (M. Joseph, P. Pandya, The Computer Journal 29(5), 1986; J. P. Lehoczky,
//! RTSS 1990, where jobs overlap). Let S be the DAG and all that may outrank it, or outrank one
//! of these, and so on. Look at a longest stretch in which work of S is pending. Only S
//! executes in it, but for one subtask of another DAG that keeps its core and started before:
//! nothing else of lower rank ever starts. So the job that is released `q T` after the
//! stretch's begin, or later, is complete within the least `X` with
//!
//! `X = blocking + own(X) + sum over S of ceil(X / T_i) volume_i`, `own(X) = (q + 1) volume`
//!
//! and `R = max over q of X_q - q T`, up to the first `q` with `X_q <= (q + 1) T`, when the next
//! job finds nothing pending. Where a younger job may win over an older one, since priorities
//! within the DAG differ, `own` is that of all jobs released by then, if these are more. There
//! is no carry-in: at the stretch's begin nothing is pending. Where S is no more than what may
//! outrank the DAG itself, and nothing blocks, all releases at once take that long.
//!
//! *EDF* (S. K. Baruah, L. E. Rosier, R. R. Howell, Real-Time Systems 2, 1990; L. George,
//! N. Rivierre, M. Spuri, INRIA RR-2966, 1996, where work keeps its core). Say a subtask is not
//! finished at its deadline, and let `t` be the time from the last instant before it at which no
//! work due by then was pending. In between only such work executes that was released since, and
//! one subtask that was not to be preempted, is due later, and so has a relative deadline above
//! `t`. So `t < demand(t) + blocking(t)`, where `demand(t)` sums `(t - D) / T + 1` times the WCET
//! (floor) over all subtasks with their own `D`. If that is false for all `t` up to the longest
//! stretch in which the core is busy, every deadline is met. Of these `t` it looks at those that
//! can be false (F. Zhang, A. Burns, IEEE Trans. Computers 58(9), 2009), from the last one down.
//!
//! The time for which long steps keep the core in the stretch (bursts, in `workload`) is added
//! to both.
//!
//! Assumes: releases at least `T` apart; WCETs above 0. The order of equal priorities and
//! deadlines is fixed. A subtask that is never preempted counts as if others preempted it, too.
//!
//! # Subtasks that keep their core once started ("limited preemption")
//!
//! The lower-ranked work that they may have to wait for, in a safe form that was derived for this
//! project.
//!
//! Let `Delta(x)` be the sum of the `x` largest lower-ranked subtasks of other DAGs. While a
//! subtask of the job waits, nothing lower starts. Lower-ranked work that it finds was
//! started before it became ready: on at most `m` cores for a source, on at most `m - 1` for
//! a later one, because the core of its predecessor has just become free. A subtask never
//! overlaps with itself, so those running are different subtasks. On `m - j` cores then
//!
//! - at most `Delta(m - j) + N Delta(m - max(j, 1))` blocks, with `N` the number of the DAG's
//!   subtasks that have a predecessor: each stretch of waiting but the first begins when
//!   one of these becomes ready;
//! - for `j = 0`, unless clipped, at most `Delta(m) + (P - 1) Delta(m - 1)`, with `P` the most
//!   subtasks on a path, by the critical chain of `pipelined` instead: only the subtasks of
//!   that one chain wait.
//!
//! Trap: the published LP-max bound (M. A. Serrano et al., "Response-Time
//! Analysis of DAG Tasks under Fixed Priority Scheduling with Limited
//! Preemptions", DATE 2016) counts blocking after the first subtask only for
//! preemptions by higher-priority work. But a DAG's own serial phases leave
//! cores idle, and those admit new lower-priority subtasks without anybody
//! being preempted: in the unit test below that gives 10 and 11 is observed.
//!
//! Under EDF any other DAG's job may have the later deadline, whatever the relative
//! deadlines: it may be released during this job. So `Delta` is over all other DAGs. An
//! instance that starts while a subtask waits is due no later than that, so it is among the
//! interference, be it up to the job's deadline or up to a sink's.
//!
//! Assumes: *no* subtask of any DAG is ever preempted; work-conserving.

use alloc::vec::Vec;

use super::task::Task;
use super::workload::WorkloadBursts;
use crate::order::sorted;

/// The most evaluations of sums under EDF, for all DAGs.
const STEP_LIMIT: u64 = 4096;

/// A DAG under static priorities.
pub(super) struct DagDemand {
    pub(super) volume_ns: u64,
    pub(super) period_ns: u64,
    /// The longest response time that is of use.
    pub(super) limit_ns: u64,
    /// Its most and its least urgent priority; each wins over the larger ones.
    pub(super) priorities: [(u32, usize); 2],
    /// The largest WCET of those that keep the core, or 0.
    pub(super) keeps_ns: u64,
}

impl DagDemand {
    /// Returns the work of jobs that are released within a window, or at its beginning.
    fn released(&self, window: u128) -> u128 {
        let jobs = window.max(1).div_ceil(self.period_ns.into());
        jobs.saturating_mul(self.volume_ns.into())
    }

    fn younger_may_win(&self) -> bool {
        self.priorities[0].0 != self.priorities[1].0
    }
}

/// The equations of a DAG's response time.
pub(super) struct ResponseEquation<'a> {
    loads: &'a [DagDemand],
    bursts: &'a WorkloadBursts,
    own: &'a DagDemand,
    /// The DAGs that may delay it, directly or through others.
    pub(super) others: Vec<usize>,
    pub(super) blocking: u128,
}

impl<'a> ResponseEquation<'a> {
    pub(super) fn of(loads: &'a [DagDemand], bursts: &'a WorkloadBursts, dag: usize) -> Self {
        let own = &loads[dag];
        let mut least = own.priorities[1];
        loop {
            // Until nothing more comes in: what may delay one of these may delay the job through
            // it.
            let outrank = loads.iter().filter(|load| load.priorities[0] < least);
            match outrank.map(|load| load.priorities[1]).max() {
                Some(lower) if lower > least => least = lower,
                _ => break,
            }
        }
        let all = (0..loads.len()).filter(|&other| other != dag);
        let (others, lower): (Vec<usize>, Vec<usize>) =
            all.partition(|&other| loads[other].priorities[0] < least);
        let blocking_ns = lower.iter().map(|&other| loads[other].keeps_ns).max();
        Self {
            loads,
            bursts,
            own,
            others,
            blocking: blocking_ns.unwrap_or(0).into(),
        }
    }

    /// Returns the response time if it is of use, found within so many steps.
    pub(super) fn solve(&self, steps: &mut u64) -> Option<u64> {
        let windows = self.windows(steps)?;
        let periods = (0..).map(|back: u128| back * u128::from(self.own.period_ns));
        let responses = windows
            .iter()
            .zip(periods)
            .map(|(window, time)| window - time);
        u64::try_from(responses.max()?).ok()
    }

    /// Returns `X_0`, `X_1`, ..
    pub(super) fn windows(&self, steps: &mut u64) -> Option<Vec<u128>> {
        let period = u128::from(self.own.period_ns);
        let mut windows: Vec<u128> = Vec::new();
        for back in 0.. {
            let mut window = windows.last().copied().unwrap_or(0);
            loop {
                *steps = steps.checked_sub(1)?;
                let after = self.busy(back, window);
                if after > back * period + u128::from(self.own.limit_ns) {
                    return None;
                }
                if after == window {
                    break;
                }
                window = after;
            }
            windows.push(window);
            // The core is done before the next job is released: that one finds nothing left over.
            if window <= (back + 1) * period {
                break;
            }
        }
        Some(windows)
    }

    /// Returns the work in a window, until the job `back` places later is complete.
    fn busy(&self, back: u128, window: u128) -> u128 {
        let others = self
            .others
            .iter()
            .map(|&other| self.loads[other].released(window));
        let own = self.own_work(back, window);
        let first = self.blocking.saturating_add(own);
        others
            .fold(first, u128::saturating_add)
            .saturating_add(self.bursts.during(window))
    }

    /// Returns the DAG's own part of that.
    pub(super) fn own_work(&self, back: u128, window: u128) -> u128 {
        let first = (back + 1).saturating_mul(self.own.volume_ns.into());
        if self.own.younger_may_win() {
            first.max(self.own.released(window))
        } else {
            first
        }
    }
}

/// The part of each job of a DAG that is due at the same time, under EDF.
pub(super) struct DueDemand {
    pub(super) deadline_ns: u64,
    pub(super) period_ns: u64,
    pub(super) volume_ns: u64,
    /// The largest WCET of those that keep the core, or 0.
    pub(super) keeps_ns: u64,
}

/// Looks for a time in which more is due than the core can execute. If there is none, returns the
/// longest stretch in which it is busy, and the times that show it; `None` also if that takes too
/// many steps.
pub(super) fn demand(all: &[DueDemand], bursts: &WorkloadBursts) -> Option<(u128, Vec<u128>)> {
    let mut steps = STEP_LIMIT;
    let blocking = |after: u128| {
        let later = all.iter().filter(|due| u128::from(due.deadline_ns) > after);
        u128::from(later.map(|due| due.keeps_ns).max().unwrap_or(0))
    };
    let sum = |jobs: &dyn Fn(&DueDemand) -> u128| {
        let volumes = all
            .iter()
            .map(|due| jobs(due).saturating_mul(due.volume_ns.into()));
        volumes.fold(0, u128::saturating_add)
    };
    let most = blocking(0);
    let mut busy = 1;
    loop {
        steps = steps.checked_sub(1)?;
        let released = sum(&|due| u128::div_ceil(busy, due.period_ns.into()));
        match most
            .saturating_add(released)
            .saturating_add(bursts.during(busy))
        {
            u128::MAX => return None,
            after if after == busy => break,
            after => busy = after,
        }
    }
    let lost = bursts.during(busy);
    // The last time before another at which something is due.
    let last_before = |time: u128| {
        let last = all.iter().filter_map(|due| {
            let (deadline, period) = (u128::from(due.deadline_ns), u128::from(due.period_ns));
            let after = time.checked_sub(deadline + 1)?;
            Some(deadline + after / period * period)
        });
        last.max()
    };
    let mut times = Vec::new();
    let mut next = last_before(busy + 1);
    while let Some(time) = next {
        steps = steps.checked_sub(1)?;
        times.push(time);
        let demand = sum(&|due| {
            let left = time.checked_sub(due.deadline_ns.into());
            left.map_or(0, |left| left / u128::from(due.period_ns) + 1)
        });
        if demand.saturating_add(blocking(time)).saturating_add(lost) > time {
            return None;
        }
        // From there on no more is due, and no more may block.
        next = last_before(time.min(demand + most + lost));
    }
    Some((busy, times))
}

/// Lower-ranked work that a job may find on the cores and must wait for.
#[derive(Clone, Debug)]
pub(super) struct Blocking {
    /// The sums of the 1, 2, .. largest subtasks, for as many as there are cores.
    largest: Vec<u128>,
    /// The most subtasks on a path of the blocked DAG.
    path: u128,
    /// Its subtasks that have a predecessor.
    later: u128,
}

impl Blocking {
    /// Returns that of a DAG which nothing blocks.
    pub(super) fn none(task: &Task) -> Self {
        Self {
            largest: Vec::new(),
            path: task.most_subtasks_on_a_path().into(),
            later: (task.subtask_count() - task.sources().len()) as u128,
        }
    }

    /// Returns that of the same DAG by subtasks of these WCETs.
    pub(super) fn by(&self, wcets_ns: &[u64], cores: u32) -> Self {
        let sums = largest(wcets_ns, cores).into_iter().scan(0, |sum, wcet| {
            *sum += u128::from(wcet);
            Some(*sum)
        });
        Self {
            largest: sums.collect(),
            ..*self
        }
    }

    /// Returns the sum of the `count` largest subtasks.
    pub(super) fn sum(&self, count: usize) -> u128 {
        let last = count.min(self.largest.len()).checked_sub(1);
        last.map_or(0, |last| self.largest[last])
    }

    /// Returns the blocking on `cores - j` cores; if not `is_clipped`, in the window.
    pub(super) fn during(&self, cores: usize, j: usize, is_clipped: bool) -> u128 {
        if j == 0 && !is_clipped {
            return self.along_a_chain(cores, 0);
        }
        let again = self.later.saturating_mul(self.sum(cores - j.max(1)));
        self.sum(cores - j).saturating_add(again)
    }

    /// Returns the blocking of a critical chain that crosses `back` releases.
    pub(super) fn along_a_chain(&self, cores: usize, back: u128) -> u128 {
        let again = (self.path + back).saturating_sub(1);
        let again = again.saturating_mul(self.sum(cores - 1));
        self.sum(cores).saturating_add(again)
    }
}

/// Returns the largest WCETs, as many as there are cores at most, the largest first.
pub(super) fn largest(wcets_ns: &[u64], cores: u32) -> Vec<u64> {
    let cores = usize::try_from(cores).unwrap_or(usize::MAX);
    let ascending = sorted(wcets_ns);
    ascending.into_iter().rev().take(cores).collect()
}
