//! Bounds for single sinks, where a job's bound is known.
//!
//! The critical chain of a sink ends with the sink, so it is at most as long as the
//! longest path to it, and its subtasks are the sink's ancestors. What delays it is what
//! delays the job, but for two things:
//!
//! - Of the job itself only subtasks count that may win over an ancestor. If all can be
//!   preempted these are, under EDF, those that reach a sink whose deadline is no later
//!   (all ancestors have deadlines no later than the sink's); under static priority,
//!   those that are not less urgent than the least urgent ancestor. If not all can be
//!   preempted, all count.
//! - Under EDF with `D <= T`, jobs of other DAGs count up to the *sink's* deadline. What is
//!   due later and keeps its core may block.
//!
//! On one core under EDF the demand test proves each sink its deadline, if it accepts the set.
//!
//! So the sink's bound is the solution of the job's equation with these figures (see
//! `pipelined`). Older and younger jobs of the DAG count as there, with the job's bound,
//! which holds for all of them. The sink finishes no later than its job: the smaller of
//! both bounds is taken. Evidence: `accepted_sets_keep_their_bounds` observes sinks, too.

use alloc::vec;
use alloc::vec::Vec;

use super::{Case, one_core};
use crate::analysis::answer::{Answer, DagBound, NotProven, Reason};
use crate::analysis::interference::Delays;
use crate::analysis::pipelined::{Figures, STEP_LIMIT};
use crate::analysis::relation::Mixture;
use crate::analysis::task::Task;
use crate::ids::SubtaskId;
use crate::order::sorted_by_key;
use crate::policy::Policy;
use crate::task_set::Dag;

/// The path to a sink, and what of its own job may delay it.
struct Reach {
    length_ns: u64,
    volume_ns: u64,
}

/// Fills in the bounds of the sinks of each DAG, in their order, that follow from the bounds
/// of jobs. A DAG of which a sink is not bounded by its own deadline is not proven.
pub(super) fn bound(case: &Case<'_>, verdict: &mut Answer, bounds: &mut [Vec<Option<u64>>]) {
    let whole_ns = verdict.bounds.iter().map(|bound| Some((*bound)?.bound_ns));
    let responses: Vec<Option<u64>> = whole_ns.collect();
    let is_met = case.relation.ranks_sinks && one_core::are_in_time(case);
    for (dag, &number) in case.members.iter().enumerate() {
        let solved = equations(case, dag, &responses).map(|(sink, equation)| {
            let solved = equation
                .and_then(|(figures, delays)| figures.solve(&delays, 0, &mut { STEP_LIMIT }).ok());
            let deadline_ns = case.dag(dag).subtask(sink).relative_deadline_ns();
            solved.or(is_met.then_some(deadline_ns))
        });
        bounds[number] = solved.collect();
    }
    for (dag, &number) in case.members.iter().enumerate() {
        let model = case.dag(dag);
        let sinks_ns = &mut bounds[number];
        let unbounded = within_deadlines(model, verdict.bounds[dag], sinks_ns);
        let reason = match (too_far(case.tasks[dag], model), unbounded) {
            (Some((sink, length_ns)), _) if !is_certain(verdict.reasons[dag]) => {
                Reason::PathBeyondDeadline { sink, length_ns }
            }
            (_, Some(sink)) => Reason::NoSinkBound { sink },
            _ => continue,
        };
        verdict.bounds[dag] = None;
        verdict.reasons[dag] = Some(reason);
        let failing = NotProven {
            dag: case.id(dag),
            reason,
        };
        verdict.first_failing.get_or_insert(failing);
    }
}

fn is_certain(reason: Option<Reason>) -> bool {
    reason.is_some_and(|reason| reason.is_certain())
}

/// Returns the equation of each sink of a DAG and what may delay it, where the response times
/// of jobs are known that it rests on.
pub(in crate::analysis) fn equations<'a>(
    case: &'a Case<'_>,
    dag: usize,
    responses: &'a [Option<u64>],
) -> impl Iterator<Item = (SubtaskId, Option<(Figures, Delays)>)> {
    let (set, model) = (&case.set, case.dag(dag));
    let (policy, preemption) = (case.settings.policy, case.relation.preemption);
    let reaches = reaches(set.tasks[dag], model, policy, preemption);
    let sinks = model.sinks().iter().zip(reaches);
    sinks.map(move |(&sink, reach)| {
        let equation = || {
            let deadline_ns = model.subtask(sink).relative_deadline_ns();
            let may_outrank = |other, dag| case.relation.may_outrank(other, dag);
            let delays = set.delays(dag, deadline_ns, responses, may_outrank).ok()?;
            let (length_ns, volume_ns) = (reach.length_ns, reach.volume_ns);
            let figures = &set.figures[dag];
            let figures = figures.of_sink(length_ns, volume_ns, deadline_ns, responses[dag]?);
            Some((figures, delays))
        };
        (sink, equation())
    })
}

/// Returns the longest path to each sink, in their order.
fn lengths_ns(task: &Task, model: &Dag) -> Vec<u64> {
    let mut lengths_ns: Vec<u64> = task.wcets_ns().to_vec();
    for subtask in task.topological_order() {
        for next in task.successors(subtask) {
            let through_ns = lengths_ns[subtask] + task.wcets_ns()[next];
            lengths_ns[next] = lengths_ns[next].max(through_ns);
        }
    }
    let sinks = model.sinks().iter();
    sinks.map(|sink| lengths_ns[sink.index()]).collect()
}

/// Completes the bounds of a DAG's sinks by that of its jobs, and returns the first sink
/// that is not bounded by its deadline; then none of them has a bound.
pub(super) fn within_deadlines(
    model: &Dag,
    whole: Option<DagBound>,
    sinks_ns: &mut [Option<u64>],
) -> Option<SubtaskId> {
    let Some(DagBound { bound_ns, .. }) = whole else {
        sinks_ns.fill(None);
        return None;
    };
    let mut late = None;
    for (&sink, sink_ns) in model.sinks().iter().zip(sinks_ns.iter_mut()) {
        let least_ns = sink_ns.map_or(bound_ns, |sink_ns| sink_ns.min(bound_ns));
        *sink_ns = Some(least_ns);
        if least_ns > model.subtask(sink).relative_deadline_ns() {
            late = late.or(Some(sink));
        }
    }
    if late.is_some() {
        sinks_ns.fill(None);
    }
    late
}

/// Returns the first sink whose longest path is longer than its deadline, and that path's
/// length.
pub(super) fn too_far(task: &Task, model: &Dag) -> Option<(SubtaskId, u64)> {
    let mut sinks = model.sinks().iter().copied().zip(lengths_ns(task, model));
    sinks.find(|&(sink, length_ns)| length_ns > model.subtask(sink).relative_deadline_ns())
}

fn reaches(task: &Task, model: &Dag, policy: Policy, preemption: Mixture) -> Vec<Reach> {
    let subtasks = model.subtasks();
    // The smaller number wins, in both.
    let urgency = |subtask: usize| match policy {
        Policy::StaticPriority => u64::from(subtasks[subtask].priority().0),
        Policy::Edf => subtasks[subtask].relative_deadline_ns(),
    };
    // The largest number among the ancestors.
    let mut least_urgent: Vec<u64> = (0..subtasks.len()).map(urgency).collect();
    for subtask in task.topological_order() {
        for next in task.successors(subtask) {
            least_urgent[next] = least_urgent[next].max(least_urgent[subtask]);
        }
    }
    // By urgency, with the sums of WCETs: a look at all subtasks for each sink takes as long
    // as the square of a large DAG's size.
    let order = sorted_by_key(subtasks.len(), urgency);
    let mut sums_ns = vec![0];
    for &subtask in &order {
        sums_ns.push(sums_ns[sums_ns.len() - 1] + task.wcets_ns()[subtask]);
    }
    let sinks = model.sinks().iter().zip(lengths_ns(task, model));
    let reach = sinks.map(|(sink, length_ns)| {
        let least = least_urgent[sink.index()];
        let counted = match preemption {
            Mixture::All => order.partition_point(|&subtask| urgency(subtask) <= least),
            Mixture::None | Mixture::Some => order.len(),
        };
        Reach {
            length_ns,
            volume_ns: sums_ns[counted],
        }
    });
    reach.collect()
}
