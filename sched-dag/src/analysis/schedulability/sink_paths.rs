//! The equations of single sinks, where the bound of their job is known.
//!
//! The critical chain of a sink ends with the sink. So the chain is at most as long as the longest
//! path to the sink, and its subtasks are the sink's ancestors. The sink is delayed by the same
//! work as the job, with two exceptions:
//!
//! - In the job itself, only subtasks that may win over an ancestor count. If all can be preempted
//!   these are, under EDF, the subtasks that reach a sink whose deadline is no later (all ancestors
//!   have deadlines no later than the sink's). In an order that is the same for every job, these
//!   are the subtasks at least as urgent as the least urgent ancestor. If not all can be preempted,
//!   or in any other order, all subtasks count.
//! - Under EDF with `D <= T`, jobs of other DAGs count up to the *sink's* deadline. Work that is
//!   due later and keeps its core may block.
//!
//! So the sink's bound is the solution of the job's equation with these figures (see `pipelined`).
//! Older and younger jobs of the DAG count as there, with the job's bound, valid for all of them.
//! The sink finishes no later than its job, so the smaller of both bounds is taken.

use alloc::vec;
use alloc::vec::Vec;

use super::multiple_paths::{listed, overlap};
use super::{BoundTest, BoundWitness, Responses, SinkBounds};
use crate::analysis::case::AnalysisInput;
use crate::analysis::features::covers;
use crate::analysis::interference::DelaySources;
use crate::analysis::pipelined::{PipelineTerms, STEP_LIMIT};
use crate::analysis::ranks::{InstanceOrder, PreemptionMix};
use crate::analysis::witness_text::WitnessText;
use crate::ids::SubtaskId;
use crate::order::sorted_by_key;

pub(super) const TEST: BoundTest = BoundTest {
    covers: covers!(
        RANKED BY_DEADLINE ANY_ORDER ONE_CORE CORES PREEMPTION ALL_KEEP SOME_KEEP SINK_DEADLINES
        INTERLEAVED LATE_DEADLINES FEW_IN_FLIGHT OVERHEADS BURSTS DEVICE SPORADIC
    ),
    sinks,
    ..BoundTest::NONE
};

pub(super) const WITNESS: BoundWitness = BoundWitness {
    sinks: write,
    ..BoundWitness::NONE
};

fn sinks(case: &AnalysisInput<'_>, responses: Responses<'_>, found: &mut SinkBounds) {
    for dag in (0..case.members.len()).filter(|&dag| TEST.is_for(case, dag)) {
        let solved = equations(case, dag, responses).map(|(_, equation)| {
            let (figures, delays) = equation?;
            figures.solve(&delays, 0, &mut { STEP_LIMIT }).ok()
        });
        found.offer(dag, solved);
    }
}

fn write(
    case: &AnalysisInput<'_>,
    responses: Responses<'_>,
    dag: usize,
    whole_ns: u64,
    text: &mut WitnessText,
) {
    for (sink, equation) in equations(case, dag, responses) {
        if let Some((figures, delays)) = equation
            && let Ok(bound_ns) = figures.solve(&delays, 0, &mut { STEP_LIMIT })
            && bound_ns < whole_ns
        {
            let listed = listed(case, dag, responses, &delays);
            let begin = format_args!("sink {} {} {bound_ns}", case.members[dag], sink.0);
            overlap(text, begin, &figures, bound_ns, &delays, &listed);
        }
    }
}

/// The path to a sink, and the work of its own job that may delay it.
struct SinkPath {
    length_ns: u64,
    volume_ns: u64,
}

/// Returns the equation of each sink of a DAG and the work that may delay it, if the response times
/// needed are known.
fn equations<'a>(
    case: &'a AnalysisInput<'_>,
    dag: usize,
    responses: &'a [Option<u64>],
) -> impl Iterator<Item = (SubtaskId, Option<(PipelineTerms, DelaySources)>)> {
    let (set, model) = (&case.set, case.dag(dag));
    let sinks = model.sinks().iter().zip(reaches(case, dag));
    sinks.map(move |(&sink, reach)| {
        let equation = || {
            let deadline_ns = model.subtask(sink).relative_deadline_ns();
            let may_outrank = |other, dag| case.relation.may_outrank(other, dag);
            let whole_ns = responses[dag]?;
            let times_ns = (whole_ns, deadline_ns);
            let delays = set.delays(dag, times_ns, responses, &may_outrank).ok()?;
            let (length_ns, volume_ns) = (reach.length_ns, reach.volume_ns);
            let figures = &set.figures[dag];
            let figures = figures.of_sink(length_ns, volume_ns, deadline_ns, whole_ns);
            Some((figures, delays))
        };
        (sink, equation())
    })
}

fn reaches(case: &AnalysisInput<'_>, dag: usize) -> Vec<SinkPath> {
    let (task, model) = (case.tasks[dag], case.dag(dag));
    // The smaller number wins.
    let numbers = case.settings.policy.numbers(model);
    // The largest number among the ancestors.
    let mut least_urgent = numbers.clone();
    for subtask in task.topological_order() {
        for next in task.successors(subtask) {
            least_urgent[next] = least_urgent[next].max(least_urgent[subtask]);
        }
    }
    // By urgency, with the sums of WCETs: a look at all subtasks for each sink would take time
    // quadratic in the size of a DAG.
    let order = sorted_by_key(numbers.len(), |subtask| numbers[subtask]);
    let mut sums_ns = vec![0];
    for &subtask in &order {
        sums_ns.push(sums_ns[sums_ns.len() - 1] + task.wcets_ns()[subtask]);
    }
    let finishes_ns = task.finishes_ns();
    let reach = model.sinks().iter().map(|sink| {
        let least = least_urgent[sink.index()];
        let is_known = case.relation.preemption == PreemptionMix::All
            && case.relation.order != InstanceOrder::Any;
        let counted = match is_known {
            true => order.partition_point(|&subtask| numbers[subtask] <= least),
            false => order.len(),
        };
        SinkPath {
            length_ns: finishes_ns[sink.index()],
            volume_ns: sums_ns[counted],
        }
    });
    reach.collect()
}
