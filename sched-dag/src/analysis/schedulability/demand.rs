//! Processor demand on one core under EDF: proves that each subtask finishes by its deadline, or
//! nothing.
//!
//! S. K. Baruah, L. E. Rosier, R. R. Howell, Real-Time Systems 2, 1990; L. George, N. Rivierre, M.
//! Spuri, INRIA RR-2966, 1996, for work that keeps its core. Say a subtask is not finished at its
//! deadline, and let `t` be the time to the deadline from the last earlier instant without pending
//! work due by the deadline. In between, the core executes only such work, released since, and at
//! most one non-preemptible subtask that is due later and so has a relative deadline above `t`. So
//! `t < demand(t) + blocking(t)`, where `demand(t)` sums `(t - D) / T + 1` times the WCET (floor)
//! over all subtasks with their own `D`. If the inequality is false for all `t` up to the longest
//! busy stretch of the core, every deadline is met. The test checks only those `t` for which the
//! inequality may hold (F. Zhang, A. Burns, IEEE Trans. Computers 58(9), 2009), from the last down.
//!
//! The time taken from the core by long steps and by a device's interrupts (bursts, in `workload`)
//! is added: in the stretch, and in each `t`, as much as falls into it.
//!
//! The proof is about all DAGs together. Under EDF each DAG may delay every other, so a feature of
//! one DAG concerns all.
//!
//! Assumes: releases at least `T` apart; WCETs above 0. The order of equal deadlines is fixed. A
//! subtask that is never preempted counts as if others preempted it, too.

use alloc::vec::Vec;

use super::{BoundTest, BoundWitness, JobBounds, Responses, SinkBounds};
use crate::analysis::case::AnalysisInput;
use crate::analysis::features::covers;
use crate::analysis::witness_text::WitnessText;
use crate::analysis::{DagBound, SchedulabilityTest};

/// The maximum number of evaluations of sums, for all DAGs.
const STEP_LIMIT: u64 = 4096;

pub(super) const TEST: BoundTest = BoundTest {
    names: &[SchedulabilityTest::Demand],
    covers: covers!(
        BY_DEADLINE ONE_CORE PREEMPTION ALL_KEEP SOME_KEEP SINK_DEADLINES LATE_DEADLINES OVERHEADS
        BURSTS DEVICE SPORADIC
    ),
    jobs,
    sinks,
};

pub(super) const WITNESS: BoundWitness = BoundWitness {
    certificate,
    job: |case, _, dag, bound_ns, text| {
        text.line(format_args!("bound {} {bound_ns} demand", case.members[dag]));
    },
    ..BoundWitness::NONE
};

fn jobs(case: &AnalysisInput<'_>, found: &mut JobBounds) {
    if found.bounds.iter().any(Option::is_none) && demand(case).is_some() {
        for (dag, task) in case.tasks.iter().enumerate() {
            found.offer(dag, task.relative_deadline_ns(), SchedulabilityTest::Demand);
        }
    }
}

fn sinks(case: &AnalysisInput<'_>, _: Responses<'_>, found: &mut SinkBounds) {
    if case.relation.ranks_sinks && demand(case).is_some() {
        for dag in 0..case.members.len() {
            let model = case.dag(dag);
            let sinks = model.sinks().iter();
            let deadlines_ns = sinks.map(|&sink| model.subtask(sink).relative_deadline_ns());
            found.offer(dag, deadlines_ns.map(Some));
        }
    }
}

fn certificate(case: &AnalysisInput<'_>, bounds: &[Option<DagBound>], text: &mut WitnessText) {
    let is_used = |bound: &DagBound| {
        case.relation.ranks_sinks || bound.test == SchedulabilityTest::Demand
    };
    if bounds.iter().flatten().any(is_used)
        && let Some((busy, times)) = demand(case)
    {
        let numbers = core::iter::once(busy).chain(times);
        text.list("demand", numbers.map(u128::cast_signed));
    }
}

/// The part of each job of a DAG with the same relative deadline, under EDF.
struct DueDemand {
    deadline_ns: u64,
    period_ns: u64,
    volume_ns: u64,
    /// The largest WCET of a subtask in this part that keeps the core, or 0.
    keeps_ns: u64,
}

/// Looks for a time with more demand than the core can execute. If there is none, returns the
/// longest busy stretch, and the times checked as evidence. Returns `None` also if the search takes
/// too many steps.
fn demand(case: &AnalysisInput<'_>) -> Option<(u128, Vec<u128>)> {
    let all: Vec<DueDemand> = (0..case.tasks.len()).flat_map(|dag| dues(case, dag)).collect();
    let (all, bursts) = (&all, &case.set.bursts);
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
    // The last time before another at which work is due.
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
        let demand = demand.saturating_add(bursts.during(time));
        if demand.saturating_add(blocking(time)) > time {
            return None;
        }
        // From there on no more work is due or lost, and no more may block.
        next = last_before(time.min(demand + most));
    }
    Some((busy, times))
}

/// Returns the demands of a DAG, one for each deadline.
fn dues(case: &AnalysisInput<'_>, dag: usize) -> Vec<DueDemand> {
    let (task, subtasks) = (case.tasks[dag], case.dag(dag).subtasks());
    let mut dues: Vec<DueDemand> = Vec::new();
    for (subtask, &wcet_ns) in subtasks.iter().zip(task.wcets_ns()) {
        let deadline_ns = subtask.relative_deadline_ns();
        let known = dues.iter().position(|due| due.deadline_ns == deadline_ns);
        let place = known.unwrap_or(dues.len());
        if known.is_none() {
            dues.push(DueDemand {
                deadline_ns,
                period_ns: task.period_ns(),
                volume_ns: 0,
                keeps_ns: 0,
            });
        }
        let due = &mut dues[place];
        due.volume_ns += wcet_ns;
        if case.keeps_core(subtask) {
            due.keeps_ns = due.keeps_ns.max(wcet_ns);
        }
    }
    dues
}
