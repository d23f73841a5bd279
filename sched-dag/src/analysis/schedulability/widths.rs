//! Widths that fit: nothing waits for a core if there are as many cores as can be needed at once.
//!
//! The width of a DAG is the size of its largest set of subtasks without precedences among them, so
//! no more instances of one job are ready or running at any instant. Let the widths of a DAG and of
//! all DAGs that may delay it add up to no more than the cores, and let no job last beyond the next
//! release. Then an instance has a core as soon as it becomes ready. So a job's response time is
//! the longest path with its waits, and a sink's is the longest path to the sink. Where subtasks
//! keep their cores, every other DAG may delay.
//!
//! Bounds rest on bounds here, but not in a circle: look at the first job to exceed its own
//! (`set`). A platform's costs are not covered: while a step hands an instance to a core, others
//! wait for the step, so an instance does not have its core at once.
//!
//! Assumes: no core idles while a subtask is ready, and each core serves each DAG (no tables, no
//! affinities). Any order.

use alloc::vec::Vec;

use super::{BoundTest, BoundWitness, JobBounds, Responses, SinkBounds};
use crate::analysis::SchedulabilityTest;
use crate::analysis::case::AnalysisInput;
use crate::analysis::features::covers;
use crate::analysis::witness_text::WitnessText;

/// The maximum number of rounds to find DAGs that do not fit.
const ROUNDS: u32 = 4;

pub(super) const TEST: BoundTest = BoundTest {
    names: &[SchedulabilityTest::Widths],
    covers: covers!(
        RANKED BY_DEADLINE ANY_ORDER CORES PREEMPTION ALL_KEEP SOME_KEEP SINK_DEADLINES
        INTERLEAVED WAITS LATE_DEADLINES FEW_IN_FLIGHT SPORADIC
    ),
    jobs,
    sinks,
};

pub(super) const WITNESS: BoundWitness = BoundWitness {
    job: |case, _, dag, bound_ns, text| {
        text.line(format_args!("bound {} {bound_ns} widths", case.members[dag]));
    },
    sinks: write_sinks,
    ..BoundWitness::NONE
};

fn jobs(case: &AnalysisInput<'_>, found: &mut JobBounds) {
    for (dag, bound) in fitting(case).into_iter().enumerate() {
        if let Some(bound_ns) = bound.filter(|_| !case.is_alone(dag)) {
            found.offer(dag, bound_ns, SchedulabilityTest::Widths);
        }
    }
}

fn sinks(case: &AnalysisInput<'_>, _: Responses<'_>, found: &mut SinkBounds) {
    for (dag, bound) in fitting(case).into_iter().enumerate() {
        if bound.is_some() {
            found.offer(dag, of_sinks(case, dag).into_iter());
        }
    }
}

fn write_sinks(
    case: &AnalysisInput<'_>,
    _: Responses<'_>,
    dag: usize,
    whole_ns: u64,
    text: &mut WitnessText,
) {
    if fitting(case)[dag].is_none() {
        return;
    }
    for (sink, bound) in case.dag(dag).sinks().iter().zip(of_sinks(case, dag)) {
        if let Some(bound_ns) = bound.filter(|&bound_ns| bound_ns < whole_ns) {
            let id = case.members[dag];
            text.line(format_args!("reached {id} {} {bound_ns}", sink.0));
        }
    }
}

/// Returns the response times of a DAG's sinks if nothing waits for a core.
fn of_sinks(case: &AnalysisInput<'_>, dag: usize) -> Vec<Option<u64>> {
    let finishes_ns = case.tasks[dag].oblivious().finishes_ns();
    let sinks = case.dag(dag).sinks().iter();
    let bounds = sinks.map(|sink| case.set.bursts.after(finishes_ns[sink.index()]));
    bounds.collect()
}

/// Returns each DAG's response time, where widths fit.
fn fitting(case: &AnalysisInput<'_>) -> Vec<Option<u64>> {
    let all = 0..case.members.len();
    let alone = all.clone().map(|dag| {
        let limit_ns = case.set.figures[dag].limit_ns();
        let limit_ns = limit_ns.min(case.tasks[dag].period_ns());
        let bound = case.set.bursts.after(case.tasks[dag].span_ns());
        bound.filter(|&bound_ns| bound_ns <= limit_ns && TEST.is_for(case, dag))
    });
    // Starts from all DAGs that may have such a bound, and drops every DAG whose widths do not fit,
    // or that rests on a DAG without a bound.
    let mut bounds: Vec<Option<u64>> = alone.collect();
    for _ in 0..ROUNDS {
        let fits = |dag: usize| bounds[dag].filter(|_| has_room(case, dag, &bounds));
        let left: Vec<Option<u64>> = all.clone().map(fits).collect();
        if left == bounds {
            return bounds;
        }
        bounds = left;
    }
    alloc::vec![None; bounds.len()]
}

/// Reports whether there are as many cores as a DAG and all DAGs that may delay it can use at once.
fn has_room(case: &AnalysisInput<'_>, dag: usize, bounds: &[Option<u64>]) -> bool {
    let cores = u64::from(case.set.cores);
    let width = |dag: usize| case.set.shapes[dag].parallelism;
    if case.is_alone(dag) {
        // The computed width is capped at the number of cores, so the true width may be larger.
        return width(dag) < cores;
    }
    let mut delaying =
        (0..bounds.len()).filter(|&other| case.relation.may_delay(other, dag));
    let sum = delaying.try_fold(width(dag), |sum, other| {
        let sum = bounds[other].map(|_| sum + width(other));
        sum.filter(|&sum| sum <= cores)
    });
    sum.is_some()
}
