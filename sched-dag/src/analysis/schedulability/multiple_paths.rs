//! The multi-path bound: the equations of all DAGs of a case, solved together.
//!
//! The work interfering with DAG `k` is decided for each pair of DAGs:
//!
//! - *Static priorities.* DAG `i` may outrank `k` if the most urgent subtask of `i` wins over the
//!   least urgent subtask of `k` (with equal priorities, the DAG committed first wins). Priorities
//!   may thus interleave: then two DAGs may outrank each other, and each counts in full for the
//!   other. This is safe: while a subtask of `k` waits, any work on the cores belongs to `k` or
//!   wins over the waiting subtask, so the DAG of that work counts.
//! - *EDF.* Every DAG may outrank every other. For two DAGs without overlapping jobs, only jobs
//!   with a deadline no later are counted (without preemption, only if `D <= T` for all DAGs): a
//!   waiting subtask is due no later than its job, so work that wins over the subtask is, too.
//!   Where sinks have deadlines of their own, a job counts as soon as the first of its deadlines is
//!   no later.
//! - *No preemption at all.* Lower-ranked subtasks block in addition, except for subtasks of DAGs
//!   that already count in full.
//! - *Any other order.* Every other DAG counts in full.
//! - *Preemption for some subtasks and not for others.* A subtask preempted again and again may
//!   find other non-preemptible subtasks each time, and the blocking term does not cover them. Then
//!   every other DAG counts in full, whatever the order: this bound holds for any work-conserving
//!   scheduler.
//!
//! If a younger job may win over an older job of the same DAG (unequal priorities inside, or no
//! preemption), the equation counts younger jobs, too. A response time beyond `in_flight` periods
//! would meet the overrun policy, and so does not count as proven.
//!
//! Where subtasks *wait* (`waiting`), in a DAG or in another DAG that may delay it, directly or
//! through others, jobs must not overlap: a bound beyond the period does not count as proven,
//! neither the DAG's own nor the bound of another DAG in its equation.
//!
//! Where DAGs are confined to groups of cores (T4 of `table`), DAGs of the same group *count*:
//! while a segment is eligible and does not execute, each core of the group executes another
//! segment of the group that wins or keeps its core. So such a DAG has the bounds of a machine with
//! as many cores, where DAGs of the group count if they may outrank it; where cores are kept, all
//! of them count. Under EDF no deadline limits the counted work, and jobs must not overlap, as
//! where subtasks wait. A group containing a core with a table is left to another test (`members`).

use alloc::vec::Vec;
use core::fmt;

use super::{BoundTest, BoundWitness, JobBounds, Responses};
use crate::analysis::case::AnalysisInput;
use crate::analysis::cover::covering;
use crate::analysis::features::covers;
use crate::analysis::interference::{DelaySources, InterferenceBound, InterferingDag};
use crate::analysis::multi_path::MultiPathEquations;
use crate::analysis::pipelined::{OWN_STEPS, PipelineTerms, SolverFailure};
use crate::analysis::ranks::{InstanceOrder, PreemptionMix};
use crate::analysis::set::BoundFailure;
use crate::analysis::waiting::reserved;
use crate::analysis::witness_text::WitnessText;
use crate::analysis::{NotProvenReason, SchedulabilityTest};
use crate::ids::to_u32;

pub(super) const TEST: BoundTest = BoundTest {
    names: &[
        SchedulabilityTest::Alone,
        SchedulabilityTest::FixedPriority,
        SchedulabilityTest::Edf,
        SchedulabilityTest::NonPreemptive,
        SchedulabilityTest::Pipelined,
        SchedulabilityTest::AnyOrder,
        SchedulabilityTest::InGroup,
    ],
    covers: covers!(
        RANKED BY_DEADLINE ANY_ORDER ONE_CORE CORES PREEMPTION ALL_KEEP SOME_KEEP SINK_DEADLINES
        INTERLEAVED GROUPS WAITS LATE_DEADLINES FEW_IN_FLIGHT OVERHEADS BURSTS DEVICE SPORADIC
    ),
    jobs,
    ..BoundTest::NONE
};

pub(super) const WITNESS: BoundWitness = BoundWitness {
    job: |case, responses, dag, bound_ns, text| {
        write(case, responses, dag, (bound_ns, case.set.clip), text);
    },
    ..BoundWitness::NONE
};

/// Bounds the DAGs without a bound so far, using the bounds of the others.
fn jobs(case: &AnalysisInput<'_>, found: &mut JobBounds) {
    let known = found.bounds.iter().map(|bound| Some((*bound)?.bound_ns));
    let known: Vec<Option<u64>> = known.collect();
    let may_outrank = |other, dag| case.may_outrank(other, dag);
    let solution = case.set.solve(&known, &case.order, &may_outrank);
    let is_asked = |dag: usize| TEST.is_for(case, dag);
    for dag in (0..known.len()).filter(|&dag| known[dag].is_none() && is_asked(dag)) {
        match solution.responses[dag] {
            Some(bound_ns) => found.offer(dag, bound_ns, form(case, dag, bound_ns)),
            None => {
                // If numbers overflowed, no equation has failed.
                let limit = BoundFailure::Own(SolverFailure::Limit);
                let failure = solution.failures[dag].unwrap_or(limit);
                found.reasons[dag] = Some(reason(case, dag, failure, &solution.responses));
            }
        }
    }
    // A bound by windows of segments may be longer than the bound by the equations.
    let by_windows = |dag: usize| {
        let bound = found.bounds[dag].filter(|of| of.test == SchedulabilityTest::Windows);
        Some((dag, again(case, dag, &solution.responses, bound?.bound_ns)?))
    };
    let shorter: Vec<_> = (0..known.len()).filter_map(by_windows).collect();
    for (dag, bound_ns) in shorter {
        found.offer(dag, bound_ns, form(case, dag, bound_ns));
    }
    let first = solution.first_failing.map(|(dag, _)| dag);
    found.first_failing = first.filter(|&dag| is_asked(dag));
}

/// Returns the bound of a DAG by its equations, up to `most_ns` and the period, given the bounds of
/// the other DAGs.
fn again(
    case: &AnalysisInput<'_>,
    dag: usize,
    responses: Responses<'_>,
    most_ns: u64,
) -> Option<u64> {
    let may_outrank = |other, dag| case.may_outrank(other, dag);
    let equations = MultiPathEquations {
        limit_ns: case.tasks[dag].period_ns().min(most_ns),
        ..case.set.equations(dag)
    };
    let delays = case.set.delays_of_job(dag, equations.limit_ns, responses, &may_outrank);
    equations.solve(&delays.ok()?, 0, &mut { OWN_STEPS }).ok()
}

/// Names the form of a response time.
fn form(case: &AnalysisInput<'_>, dag: usize, bound_ns: u64) -> SchedulabilityTest {
    if case.tells_cores() {
        SchedulabilityTest::InGroup
    } else if bound_ns > case.tasks[dag].period_ns() {
        SchedulabilityTest::Pipelined
    } else if case.is_alone(dag) {
        SchedulabilityTest::Alone
    } else {
        match (case.relation.preemption, case.relation.order) {
            (PreemptionMix::Some, _) | (_, InstanceOrder::Any) => SchedulabilityTest::AnyOrder,
            (PreemptionMix::None, _) => SchedulabilityTest::NonPreemptive,
            (PreemptionMix::All, InstanceOrder::Ranked) => SchedulabilityTest::FixedPriority,
            (PreemptionMix::All, InstanceOrder::ByDeadline) => SchedulabilityTest::Edf,
        }
    }
}

fn reason(
    case: &AnalysisInput<'_>,
    dag: usize,
    failure: BoundFailure,
    responses: Responses<'_>,
) -> NotProvenReason {
    let task = case.tasks[dag];
    let in_flight = case.dag(dag).in_flight();
    let room = u128::from(in_flight) * u128::from(task.period_ns());
    match failure {
        BoundFailure::Other(other) => NotProvenReason::DelayedBy {
            dag: case.id(other),
        },
        BoundFailure::Overlapping => NotProvenReason::NoBoundByPeriod,
        BoundFailure::Own(SolverFailure::Limit) => NotProvenReason::Limit,
        BoundFailure::Own(SolverFailure::BeyondDeadline) if case.set.waits_enter(dag) => {
            let (span_ns, limit_ns) = (task.span_ns(), case.set.figures[dag].limit_ns());
            match (span_ns > limit_ns, limit_ns < task.relative_deadline_ns()) {
                (true, _) => NotProvenReason::SpanBeyondLimit { span_ns, limit_ns },
                (false, true) => NotProvenReason::NoBoundByPeriod,
                (false, false) => late(case, dag, responses),
            }
        }
        BoundFailure::Own(SolverFailure::BeyondDeadline)
            // A job may wait for room until its deadline has passed, however fast the others are.
            if room < u128::from(task.relative_deadline_ns()) =>
        {
            NotProvenReason::InFlightTooFew { in_flight }
        }
        BoundFailure::Own(SolverFailure::BeyondDeadline) => late(case, dag, responses),
    }
}

/// Looks for a bound beyond the deadline based on bounds of other DAGs alone. One core has better
/// bounds than the equations give.
fn late(case: &AnalysisInput<'_>, dag: usize, responses: Responses<'_>) -> NotProvenReason {
    match again(case, dag, responses, u64::MAX).filter(|_| case.settings.cores > 1) {
        Some(bound_ns) => NotProvenReason::BoundBeyondDeadline { bound_ns },
        None => NotProvenReason::NoBound,
    }
}

/// Writes the first form that proves a bound.
pub(super) fn write(
    case: &AnalysisInput<'_>,
    responses: Responses<'_>,
    dag: usize,
    (bound_ns, clip): (u64, InterferenceBound),
    text: &mut WitnessText,
) {
    let may_outrank = |other, dag| case.may_outrank(other, dag);
    let Ok(delays) = case.set.delays_of_job(dag, bound_ns, responses, &may_outrank) else {
        return;
    };
    let listed = listed(case, dag, responses, &delays);
    if bound_ns > case.tasks[dag].period_ns() {
        let figures = &case.set.figures[dag];
        let begin = format_args!("bound {} {bound_ns} overlap", case.members[dag]);
        overlap(text, begin, figures, bound_ns, &delays, &listed);
    } else {
        let equations = MultiPathEquations { clip, ..case.set.equations(dag) };
        paths(text, case.members[dag], bound_ns, &equations, &delays, &listed);
    }
}

fn paths(
    text: &mut WitnessText,
    id: usize,
    bound_ns: u64,
    equations: &MultiPathEquations<'_>,
    delays: &DelaySources,
    listed: &[OutrankingDag<'_>],
) {
    let task = equations.task;
    let waiting = bound_ns - task.span_ns();
    let enough = |cores: u128| cores * u128::from(waiting);
    let mut forms = equations.forms(delays, bound_ns);
    let Some(form) = forms.find(|form| equations.lacks(delays, bound_ns, form).is_none()) else {
        return;
    };
    let is_sharp = form.busy.value > enough(form.cores);
    let (cores, busy) = (form.cores, form.busy.value - u128::from(is_sharp));
    let chains = equations.cores + 1 - usize::try_from(cores).unwrap_or(0);
    let by_cover = equations.covers.get(chains - 1).map(|cover| {
        let left = task.oblivious().volume_ns() - cover;
        left.max(u64::from(form.is_clipped && !is_sharp))
    });
    let own = equations.left[chains - 1];
    match (delays.left_and_blocking, by_cover) {
        (Some(left), _) => {
            text.line(format_args!("bound {id} {bound_ns} blocked {left} {busy}"))
        }
        (None, Some(left)) if form.is_clipped || left == own => {
            let place = usize::from(form.is_clipped) + usize::from(is_sharp);
            let word = ["paths", "waiting", "sharp"][place];
            let blocked = delays
                .blocking
                .during(equations.cores, chains - 1, form.is_clipped);
            text.line(format_args!(
                "bound {id} {bound_ns} {word} {chains} {cores} {left} {blocked} {busy}"
            ));
            let most = equations.covers.len();
            text.chains("chain", &covering(task.oblivious(), most, chains));
        }
        _ => {
            let chains = chains - 1;
            text.line(format_args!(
                "bound {id} {bound_ns} reserved {chains} {cores} {own} {busy}"
            ));
            let reserved = reserved(task, to_u32(equations.cores)).into_iter();
            let reserved = reserved.skip(1).take(chains).map(|with| with.chain);
            text.chains("chain", &reserved.collect::<Vec<_>>());
        }
    }
    for other in listed {
        let count = usize::try_from(cores).unwrap_or(usize::MAX);
        let (count, [all, clipped]) = other.workloads.on((bound_ns, waiting), count);
        let (id, response) = (other.id, other.response_ns);
        if form.is_clipped {
            text.line(format_args!(
                "other {id} {response} {count} {all} {clipped}"
            ));
        } else {
            text.line(format_args!("other {id} {response} {count} {all}"));
        }
    }
}

pub(super) fn overlap(
    text: &mut WitnessText,
    begin: fmt::Arguments<'_>,
    figures: &PipelineTerms,
    bound_ns: u64,
    delays: &DelaySources,
    listed: &[OutrankingDag<'_>],
) {
    let Ok((windows, own)) = figures.windows(delays, bound_ns) else {
        return;
    };
    text.line(format_args!("{begin} {own}"));
    for (back, window) in windows.iter().enumerate() {
        let window_ns = u64::try_from(*window).unwrap_or(u64::MAX);
        let busy = figures.busy(back as u128, own, delays, window_ns).value;
        text.line(format_args!("window {window} {busy}"));
        for other in listed {
            let (count, [all, _]) = other.workloads.on((window_ns, 0), usize::MAX);
            let (id, response) = (other.id, other.response_ns);
            text.line(format_args!("other {id} {response} {count} {all}"));
        }
    }
}

/// A DAG that may outrank another, with its number in the commit.
pub(super) struct OutrankingDag<'a> {
    id: usize,
    response_ns: u64,
    workloads: &'a InterferingDag,
}

/// Lists the DAGs that may outrank a DAG, in the order of their workloads.
pub(super) fn listed<'a>(
    case: &AnalysisInput<'_>,
    dag: usize,
    responses: &[Option<u64>],
    delays: &'a DelaySources,
) -> Vec<OutrankingDag<'a>> {
    let ids = (0..responses.len()).filter(|&other| case.may_outrank(other, dag));
    let listed = ids
        .zip(&delays.others)
        .map(|(other, workloads)| OutrankingDag {
            id: case.members[other],
            response_ns: responses[other].unwrap_or(u64::MAX),
            workloads,
        });
    listed.collect()
}
