//! The verdict at commit: from cheap to costly, the first test that is sound.
//!
//! [`answer`] looks at what is certain (missing WCETs, a path longer than the
//! deadline, a subtask longer than the period, more work than cores), then
//! solves the response-time equations of the set, and finally asks the demand
//! test of one core about what those leave open; it gives only the deadline as the bound.
//!
//! The work that interferes with DAG `k` is decided for each pair of DAGs:
//!
//! - *Static priorities.* DAG `i` may outrank `k` if its most urgent subtask
//!   wins over `k`'s least urgent one (equal priorities: the DAG committed
//!   first wins). Priorities may thus interleave: then two DAGs may outrank
//!   each other and each counts in full for the other. That is safe: while a
//!   subtask of `k` waits, whatever runs on the cores belongs to `k` or wins
//!   over that subtask, so its DAG is among those counted.
//! - *EDF.* Every DAG may outrank every other. If `D <= T` for all DAGs, only
//!   jobs with a deadline no later are counted: a subtask that waits is due no later than
//!   its job, so what wins over it is, too. Where sinks have deadlines of their own, a job
//!   counts as soon as the first of its deadlines is no later.
//! - *No preemption at all.* Lower-ranked subtasks block besides; those of
//!   DAGs that count in full are counted already.
//! - *Preemption for some subtasks and not for others.* A subtask preempted
//!   again and again may find other non-preemptible ones each time, which the
//!   blocking term does not cover. Then every other DAG counts in full, in
//!   whatever order: true of any work-conserving scheduler.
//! - *One core.* There are exact tests, with what keeps the core as blocking (see `one_core`).
//!   Under static priorities they come first, under EDF last, as they give only the deadline.
//! - *Alone.* A DAG that nothing may outrank or block, and whose bound is
//!   within its period, may have a shorter one by its subtasks' priorities.
//!
//! If a younger job may win over an older one of the same DAG (unequal
//! priorities inside, or no preemption), the equation counts younger jobs too.
//! A response time beyond `in_flight` periods would meet the overrun policy;
//! it does not count as proven.
//!
//! Where subtasks *wait* (`waiting`), of a DAG or of one that may delay it, directly or through
//! others, jobs must not overlap: a bound beyond the period does not count as proven, the DAG's
//! own or that of another in its equation. The tests for one core and by intra-task
//! priorities have no term for waits and are not asked, nor is the equation of single sinks.
//!
//! # Bounds for single sinks, where a job's bound is known
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

use super::case::{AnalysisInput, CaseBounds, are_in_time, dag_id, of_cluster, with_case};
use super::interference::DelaySources;
use super::pinned::PinnedCluster;
use super::pipelined::{PipelineTerms, STEP_LIMIT, SolverFailure};
use super::ranks::PreemptionMix;
use super::ratio::Ratio;
use super::set::BoundFailure;
use super::task::Task;
use super::{
    AnalysisResult, AnalysisSettings, DagBound, NotProven, NotProvenReason, SchedulabilityTest,
};
use crate::ids::{SubtaskId, to_u32};
use crate::order::sorted_by_key;
use crate::policy::Policy;
use crate::task_set::{Dag, TaskSet};

/// Bounds the response time of every DAG, as far as a test proves it.
///
/// Clusters share no core, so each is a case of its own. A signal from one to another needs
/// no term: a sporadic DAG counts as if signals came as fast as they may.
#[must_use]
pub fn answer(task_set: &TaskSet, settings: &AnalysisSettings) -> AnalysisResult {
    let dags = task_set.dags();
    let unknown = dags.iter().map(|dag| vec![None; dag.sinks().len()]);
    let mut answer = AnalysisResult {
        bounds: vec![None; dags.len()],
        sinks_ns: unknown.collect(),
        reasons: vec![None; dags.len()],
        first_failing: None,
    };
    for cluster in task_set.clusters() {
        let own = (0..dags.len()).filter(|&dag| dags[dag].cluster() == cluster);
        let own: Vec<usize> = own.collect();
        let cores = to_u32(task_set.cores_of(cluster, settings.cores).len());
        let settings = of_cluster(settings, cores, own.iter().map(|&dag| &dags[dag]));
        let first_failing = &mut answer.first_failing;
        with_case(
            dags,
            &own,
            &settings,
            &mut answer.reasons,
            |case, reasons| {
                let mut verdict = case.verdict();
                bound(case, &mut verdict, &mut answer.sinks_ns);
                let first = first_unknown(&own, reasons).or(verdict.first_failing);
                *first_failing = first_failing.or(first);
                for (position, &dag) in case.members.iter().enumerate() {
                    answer.bounds[dag] = verdict.bounds[position];
                    reasons[dag] = verdict.reasons[position];
                }
            },
        );
    }
    answer
}

impl AnalysisInput<'_> {
    /// Answers for the jobs of the DAGs of this case, by their positions in it; names
    /// them by their positions in the commit.
    pub(super) fn verdict(&self) -> AnalysisResult {
        let (bounds, mut reasons, mut first) = match self.is_pinned() {
            true => PinnedCluster::of(self).bounds(self),
            false => self.solved(),
        };
        if reasons.iter().any(Option::is_some) {
            for (dag, reason) in self.certain().into_iter().rev() {
                if bounds[dag].is_none() {
                    reasons[dag] = Some(reason);
                    first = Some(dag);
                }
            }
        }
        let first_failing = first.and_then(|dag| {
            let reason = reasons[dag]?;
            let dag = self.id(dag);
            Some(NotProven { dag, reason })
        });
        AnalysisResult {
            bounds,
            sinks_ns: Vec::new(),
            reasons,
            first_failing,
        }
    }

    /// Solves the equations of the set, and asks what vouches for what they leave open.
    fn solved(&self) -> CaseBounds {
        let may_outrank = |other, dag| self.relation.may_outrank(other, dag);
        let solution = self.set.solve(&self.order, may_outrank);
        let mut bounds: Vec<Option<DagBound>> = (solution.responses.iter().enumerate())
            .map(|(dag, response)| response.map(|bound_ns| self.bound(dag, bound_ns)))
            .collect();
        // The test that gives no response times is asked last: its bound is the deadline.
        if bounds.iter().any(Option::is_none) && are_in_time(self) {
            for (bound, task) in bounds.iter_mut().zip(self.tasks) {
                bound.get_or_insert(DagBound {
                    bound_ns: task.relative_deadline_ns(),
                    test: SchedulabilityTest::Demand,
                });
            }
        }
        let reasons = (bounds.iter().enumerate()).map(|(dag, bound)| match bound {
            Some(_) => None,
            None => solution.failures[dag].map(|failure| self.reason(dag, failure)),
        });
        let reasons = reasons.collect();
        let first = solution.first_failing.map(|(dag, _)| dag);
        (bounds, reasons, first)
    }

    /// Names the test behind a response time of the set's equations.
    fn bound(&self, dag: usize, bound_ns: u64) -> DagBound {
        let test = if self.set.known[dag].is_some() {
            match self.settings.cores {
                1 => SchedulabilityTest::OneCore,
                _ => SchedulabilityTest::IntraTask,
            }
        } else if bound_ns > self.tasks[dag].period_ns() {
            SchedulabilityTest::Pipelined
        } else if self.is_alone(dag) {
            SchedulabilityTest::Alone
        } else {
            match (self.relation.preemption, self.settings.policy) {
                (PreemptionMix::Some, _) => SchedulabilityTest::AnyOrder,
                (PreemptionMix::None, _) => SchedulabilityTest::NonPreemptive,
                (PreemptionMix::All, Policy::StaticPriority) => SchedulabilityTest::FixedPriority,
                (PreemptionMix::All, Policy::Edf) => SchedulabilityTest::Edf,
            }
        };
        DagBound { bound_ns, test }
    }

    fn reason(&self, dag: usize, failure: BoundFailure) -> NotProvenReason {
        let task = self.tasks[dag];
        let in_flight = self.dag(dag).in_flight();
        let room = u128::from(in_flight) * u128::from(task.period_ns());
        match failure {
            BoundFailure::Other(other) => NotProvenReason::DelayedBy {
                dag: self.id(other),
            },
            BoundFailure::Overlapping => NotProvenReason::NoBoundByPeriod,
            BoundFailure::Own(SolverFailure::Limit) => NotProvenReason::Limit,
            BoundFailure::Own(SolverFailure::BeyondDeadline) if self.set.waits_enter(dag) => {
                let (span_ns, limit_ns) = (task.span_ns(), self.set.figures[dag].limit_ns());
                match (span_ns > limit_ns, limit_ns < task.relative_deadline_ns()) {
                    (true, _) => NotProvenReason::SpanBeyondLimit { span_ns, limit_ns },
                    (false, true) => NotProvenReason::NoBoundByPeriod,
                    (false, false) => NotProvenReason::NoBound,
                }
            }
            BoundFailure::Own(SolverFailure::BeyondDeadline)
                // A job may wait for room until its deadline has passed, however fast the others
                // are.
                if room < u128::from(task.relative_deadline_ns()) =>
            {
                NotProvenReason::InFlightTooFew { in_flight }
            }
            BoundFailure::Own(SolverFailure::BeyondDeadline) => NotProvenReason::NoBound,
        }
    }

    /// Reports whether jobs are certain to come; a sporadic DAG's signals may not.
    fn must_keep_up(&self, dag: usize) -> bool {
        !self.dag(dag).is_sporadic()
    }

    /// Finds the DAGs that cannot keep up at WCETs: by urgency those that could
    /// not even alone, then the first at which the cores do not suffice.
    fn certain(&self) -> Vec<(usize, NotProvenReason)> {
        let hopeless = |&dag: &usize| {
            let task = self.tasks[dag];
            let length_ns = task.length_ns();
            if length_ns > task.relative_deadline_ns() {
                return Some((dag, NotProvenReason::LengthBeyondDeadline { length_ns }));
            }
            // A sporadic DAG may get no signals at all, so an overload is not certain.
            if !self.must_keep_up(dag) {
                return None;
            }
            let ids = (0_u32..).map(SubtaskId).zip(task.wcets_ns());
            let mut long = ids.filter(|&(_, &wcet)| wcet > task.period_ns());
            let (subtask, _) = long.next()?;
            Some((dag, NotProvenReason::SubtaskBeyondPeriod { subtask }))
        };
        let mut certain: Vec<(usize, NotProvenReason)> =
            self.order.iter().filter_map(hopeless).collect();
        let cores = u128::from(self.settings.cores);
        let mut used = Vec::new();
        for &dag in self.order.iter().filter(|&&dag| self.must_keep_up(dag)) {
            used.push((self.tasks[dag].volume_ns(), self.tasks[dag].period_ns()));
            let Some(sum) = Ratio::sum(used.iter().copied()) else {
                break;
            };
            // The DAGs so far need more than all cores: the least urgent of them cannot keep up.
            if !sum.at_most(cores, 1) {
                if certain.iter().all(|&(hopeless, _)| hopeless != dag) {
                    certain.push((dag, NotProvenReason::Overload));
                }
                break;
            }
        }
        certain
    }
}

/// Returns the first DAG at the positions `among` that cannot be analysed for a reason of its own.
fn first_unknown(among: &[usize], reasons: &[Option<NotProvenReason>]) -> Option<NotProven> {
    let own = |reason: &NotProvenReason| !matches!(reason, NotProvenReason::DelayedBy { .. });
    let mut unknown = among.iter().filter_map(|&dag| {
        let reason = reasons[dag].filter(own)?;
        let dag = dag_id(dag);
        Some(NotProven { dag, reason })
    });
    unknown.next()
}

/// The path to a sink, and what of its own job may delay it.
struct SinkPath {
    length_ns: u64,
    volume_ns: u64,
}

/// Fills in the bounds of the sinks of each DAG, in their order, that follow from the bounds
/// of jobs. A DAG of which a sink is not bounded by its own deadline is not proven.
fn bound(case: &AnalysisInput<'_>, verdict: &mut AnalysisResult, bounds: &mut [Vec<Option<u64>>]) {
    let whole_ns = verdict.bounds.iter().map(|bound| Some((*bound)?.bound_ns));
    let responses: Vec<Option<u64>> = whole_ns.collect();
    let is_met = case.relation.ranks_sinks && are_in_time(case);
    let pinned = case.is_pinned().then(|| PinnedCluster::of(case));
    for (dag, &number) in case.members.iter().enumerate() {
        let solved = equations(case, dag, &responses).map(|(sink, equation)| {
            let solved = equation
                .and_then(|(figures, delays)| figures.solve(&delays, 0, &mut { STEP_LIMIT }).ok());
            let pinned = || pinned.as_ref()?.finish_ns(case, dag, sink);
            let solved = solved.or_else(pinned);
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
                NotProvenReason::PathBeyondDeadline { sink, length_ns }
            }
            (_, Some(sink)) => NotProvenReason::NoSinkBound { sink },
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

fn is_certain(reason: Option<NotProvenReason>) -> bool {
    reason.is_some_and(|reason| reason.is_certain())
}

/// Returns the equation of each sink of a DAG and what may delay it, where the response times
/// of jobs are known that it rests on.
pub(super) fn equations<'a>(
    case: &'a AnalysisInput<'_>,
    dag: usize,
    responses: &'a [Option<u64>],
) -> impl Iterator<Item = (SubtaskId, Option<(PipelineTerms, DelaySources)>)> {
    let (set, model) = (&case.set, case.dag(dag));
    let (policy, preemption) = (case.settings.policy, case.relation.preemption);
    let reaches = reaches(set.tasks[dag], model, policy, preemption);
    let sinks = model.sinks().iter().zip(reaches);
    sinks.map(move |(&sink, reach)| {
        let equation = || {
            if case.is_pinned() || set.waits_enter(dag) {
                return None;
            }
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
    let finishes_ns = task.finishes_ns();
    let sinks = model.sinks().iter();
    sinks.map(|sink| finishes_ns[sink.index()]).collect()
}

/// Completes the bounds of a DAG's sinks by that of its jobs, and returns the first sink
/// that is not bounded by its deadline; then none of them has a bound.
fn within_deadlines(
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
fn too_far(task: &Task, model: &Dag) -> Option<(SubtaskId, u64)> {
    let mut sinks = model.sinks().iter().copied().zip(lengths_ns(task, model));
    sinks.find(|&(sink, length_ns)| length_ns > model.subtask(sink).relative_deadline_ns())
}

fn reaches(task: &Task, model: &Dag, policy: Policy, preemption: PreemptionMix) -> Vec<SinkPath> {
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
            PreemptionMix::All => order.partition_point(|&subtask| urgency(subtask) <= least),
            PreemptionMix::None | PreemptionMix::Some => order.len(),
        };
        SinkPath {
            length_ns,
            volume_ns: sums_ns[counted],
        }
    });
    reach.collect()
}
