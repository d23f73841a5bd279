//! Exact response times on one core under static priorities.
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
//! The time for which long steps and a device's interrupts keep the core in the stretch (bursts, in
//! `workload`) is added.
//!
//! Assumes: releases at least `T` apart; WCETs above 0. The order of equal priorities is fixed.
//! A subtask that is never preempted counts as if others preempted it, too.

use alloc::vec;
use alloc::vec::Vec;

use super::{BoundTest, BoundWitness, JobBounds, Responses};
use crate::analysis::SchedulabilityTest;
use crate::analysis::case::AnalysisInput;
use crate::analysis::features::covers;
use crate::analysis::set::EvaluationBudget;
use crate::analysis::witness_text::WitnessText;
use crate::analysis::workload::WorkloadBursts;

pub(super) const TEST: BoundTest = BoundTest {
    names: &[SchedulabilityTest::OneCore],
    covers: covers!(
        RANKED ONE_CORE PREEMPTION ALL_KEEP SOME_KEEP INTERLEAVED LATE_DEADLINES FEW_IN_FLIGHT
        OVERHEADS BURSTS DEVICE SPORADIC
    ),
    jobs,
    ..BoundTest::NONE
};

pub(super) const WITNESS: BoundWitness = BoundWitness {
    job: write,
    ..BoundWitness::NONE
};

/// Bounds the response times of DAGs that something may delay, where all that may delay them
/// keep their own.
fn jobs(case: &AnalysisInput<'_>, found: &mut JobBounds) {
    let (loads, bursts) = (&loads(case), &case.set.bursts);
    let (mut steps, mut solved) = (EvaluationBudget::of(loads.len()), vec![None; loads.len()]);
    for &dag in &case.order {
        solved[dag] = steps.spend(dag, |steps| {
            ResponseEquation::of(loads, bursts, dag).solve(steps)
        });
    }
    for dag in 0..loads.len() {
        let others = ResponseEquation::of(loads, bursts, dag).others;
        let are_known = others.iter().all(|&other| solved[other].is_some());
        if let Some(bound_ns) = solved[dag].filter(|_| are_known && !case.is_alone(dag)) {
            found.offer(dag, bound_ns, SchedulabilityTest::OneCore);
        }
    }
}

fn write(
    case: &AnalysisInput<'_>,
    _: Responses<'_>,
    dag: usize,
    bound_ns: u64,
    text: &mut WitnessText,
) {
    let (id, loads) = (case.members[dag], loads(case));
    let response = ResponseEquation::of(&loads, &case.set.bursts, dag);
    let blocked = response.blocking;
    text.line(format_args!("bound {id} {bound_ns} response {blocked}"));
    let windows = response.windows(&mut { u64::MAX }).unwrap_or_default();
    for (back, window) in (0..).zip(windows) {
        let own = response.own_work(back, window);
        text.line(format_args!("window {window} {own}"));
    }
}

/// Returns the DAGs of a case as their response times need them.
fn loads(case: &AnalysisInput<'_>) -> Vec<DagDemand> {
    let loads = case.tasks.iter().enumerate().map(|(dag, task)| {
        let subtasks = case.dag(dag).subtasks().iter().zip(task.wcets_ns());
        let keeping = subtasks.filter(|(subtask, _)| case.keeps_core(subtask));
        DagDemand {
            volume_ns: task.volume_ns(),
            period_ns: task.period_ns(),
            limit_ns: case.set.figures[dag].limit_ns(),
            priorities: case.relation.ranks(dag),
            keeps_ns: keeping.map(|(_, &wcet_ns)| wcet_ns).max().unwrap_or(0),
        }
    });
    loads.collect()
}

/// A DAG under static priorities.
struct DagDemand {
    volume_ns: u64,
    period_ns: u64,
    /// The longest response time that is of use.
    limit_ns: u64,
    /// Its most and its least urgent priority; each wins over the larger ones.
    priorities: [(u64, usize); 2],
    /// The largest WCET of those that keep the core, or 0.
    keeps_ns: u64,
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
struct ResponseEquation<'a> {
    loads: &'a [DagDemand],
    bursts: &'a WorkloadBursts,
    own: &'a DagDemand,
    /// The DAGs that may delay it, directly or through others.
    others: Vec<usize>,
    blocking: u128,
}

impl<'a> ResponseEquation<'a> {
    fn of(loads: &'a [DagDemand], bursts: &'a WorkloadBursts, dag: usize) -> Self {
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
    fn solve(&self, steps: &mut u64) -> Option<u64> {
        let windows = self.windows(steps)?;
        let periods = (0..).map(|back: u128| back * u128::from(self.own.period_ns));
        let responses = windows
            .iter()
            .zip(periods)
            .map(|(window, time)| window - time);
        u64::try_from(responses.max()?).ok()
    }

    /// Returns `X_0`, `X_1`, ..
    fn windows(&self, steps: &mut u64) -> Option<Vec<u128>> {
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
    fn own_work(&self, back: u128, window: u128) -> u128 {
        let first = (back + 1).saturating_mul(self.own.volume_ns.into());
        if self.own.younger_may_win() {
            first.max(self.own.released(window))
        } else {
            first
        }
    }
}
