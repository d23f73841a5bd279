//! The verdict at commit: the findings of the tests, or the reason for a missing bound.
//!
//! [`answer`] asks the [tests](super::schedulability) about the jobs of each cluster, and then
//! about their sinks. A DAG is not proven if one of its sinks has no bound within the sink's own
//! deadline. Certain findings (missing WCETs, a path longer than the deadline, a subtask longer
//! than the period, more work than cores) take precedence over the tests' reasons.

use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;

use super::abstraction::NotClosed;
use super::case::{AnalysisInput, dag_id, of_cluster, with_case};
use super::certificate::write_certificate;
use super::explore::{STATE_LIMIT, explore};
use super::ratio::Ratio;
use super::schedulability::{JobBounds, bound_by_each, bound_jobs, bound_sinks, is_graph_asked};
use super::task::Task;
use super::{AnalysisResult, AnalysisSettings, DagBound, NotProven, NotProvenReason};
use crate::ids::{SubtaskId, to_u32};
use crate::table::Table;
use crate::task_set::{Dag, TaskSet};

/// Bounds the response time of every DAG, as far as a test proves a bound.
///
/// Clusters share no core, so each is a case of its own. A signal between clusters needs no term: a
/// sporadic DAG counts as if signals came as fast as allowed. A lock shared between clusters is
/// charged as if all cores of the machine entered it.
#[must_use]
pub fn answer(task_set: &TaskSet, settings: &AnalysisSettings) -> AnalysisResult {
    let dags = task_set.dags();
    let unknown = dags.iter().map(|dag| vec![None; dag.sinks().len()]);
    let mut answer = AnalysisResult {
        bounds: vec![None; dags.len()],
        sinks_ns: unknown.collect(),
        reasons: Vec::new(),
        first_failing: None,
    };
    let mut reasons = vec![None; dags.len()];
    each_case(
        task_set,
        settings,
        &mut reasons,
        &mut |own, case, mut verdict, reasons| {
            bound(case, &mut verdict, &mut answer.sinks_ns);
            let first = first_own(own, reasons).or(verdict.first_failing);
            answer.first_failing = answer.first_failing.or(first);
            for (position, &dag) in case.members.iter().enumerate() {
                answer.bounds[dag] = verdict.bounds[position];
                reasons[dag] = verdict.reasons[position];
            }
        },
    );
    answer.reasons = reasons;
    // The first failing DAG must be one without a bound in the end, named with its final reason.
    let all: Vec<usize> = (0..dags.len()).collect();
    let first = answer.first_failing.map(|failing| failing.dag.index());
    answer.first_failing = (first.and_then(|dag| first_own(&[dag], &answer.reasons)))
        .or_else(|| first_own(&all, &answer.reasons));
    answer
}

/// Bounds the response time of every DAG by each successful test. Each test assumes the smallest
/// known bounds of the other DAGs, whichever test proves them.
#[must_use]
pub fn bounds_by_test(task_set: &TaskSet, settings: &AnalysisSettings) -> Vec<Vec<DagBound>> {
    let mut found = vec![Vec::new(); task_set.dags().len()];
    let mut reasons = vec![None; found.len()];
    each_case(task_set, settings, &mut reasons, &mut |_, case, _, _| {
        for (&dag, bounds) in case.members.iter().zip(bound_by_each(case)) {
            found[dag] = bounds;
        }
    });
    found
}

/// Explores a set with undivided cores, and returns its certificate for a later commit with the
/// same settings.
///
/// # Errors
///
/// The set is not covered, or has no closed list within the limit.
pub fn certify(task_set: &TaskSet, settings: &AnalysisSettings) -> Result<String, NotClosed> {
    let (mut found, mut reasons) = (
        Err(NotClosed::NotCovered),
        vec![None; task_set.dags().len()],
    );
    each_case(task_set, settings, &mut reasons, &mut |_, case, _, _| {
        if !is_graph_asked(case) {
            return;
        }
        found = case.graph().and_then(|graph| {
            let states = explore(&graph, STATE_LIMIT)?;
            Ok(write_certificate(&graph, &states))
        });
    });
    match task_set.is_divided() {
        true => Err(NotClosed::NotCovered),
        false => found,
    }
}

/// Calls `work` for the case of each cluster, with the positions of all DAGs of the cluster.
fn each_case(
    task_set: &TaskSet,
    settings: &AnalysisSettings,
    reasons: &mut [Option<NotProvenReason>],
    work: &mut CaseWork<'_>,
) {
    let dags = task_set.dags();
    for cluster in task_set.clusters() {
        let own = (0..dags.len()).filter(|&dag| dags[dag].cluster() == cluster);
        let own: Vec<usize> = own.collect();
        let cores = to_u32(task_set.cores_of(cluster, settings.cores).len());
        let settings = of_cluster(settings, cores, &mut own.iter().map(|&dag| &dags[dag]));
        let tables = task_set.tables().iter();
        let tables: Vec<&Table> = tables.filter(|table| table.cluster == cluster).collect();
        with_case(
            (dags, &tables, task_set.certificate()),
            &own,
            &settings,
            reasons,
            |case, verdict, reasons| work(&own, case, verdict, reasons),
        );
    }
}

type CaseWork<'w> =
    dyn FnMut(&[usize], &AnalysisInput<'_>, AnalysisResult, &mut [Option<NotProvenReason>]) + 'w;

impl AnalysisResult {
    /// Takes all bounds away for the given reason.
    pub(super) fn refuse(&mut self, reason: NotProvenReason) {
        for (bound, own) in self.bounds.iter_mut().zip(&mut self.reasons) {
            *own = own.or(bound.take().map(|_| reason));
        }
    }
}

impl AnalysisInput<'_> {
    /// Answers for the jobs of this case's DAGs. Bounds and reasons are by position in the case,
    /// but DAGs named in them have their position in the commit.
    pub(super) fn verdict(&self) -> AnalysisResult {
        let JobBounds {
            bounds,
            mut reasons,
            first_failing: mut first,
            ..
        } = bound_jobs(self);
        if reasons.iter().any(Option::is_some) {
            // A certain miss tells the user more than the failure of a test.
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

    /// Reports whether jobs are certain to come; signals of a sporadic DAG may stay away.
    fn must_keep_up(&self, dag: usize) -> bool {
        !self.dag(dag).is_sporadic()
    }

    /// Finds the DAGs that cannot keep up at WCETs: by urgency, first those that could not even
    /// alone, then the first DAG with which the cores do not suffice.
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
            // The DAGs so far need more than all cores, so the least urgent of them cannot keep up.
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

/// Returns the first DAG at the positions `among` that has no bound for a reason of its own.
fn first_own(among: &[usize], reasons: &[Option<NotProvenReason>]) -> Option<NotProven> {
    let own = |reason: &NotProvenReason| !matches!(reason, NotProvenReason::DelayedBy { .. });
    let mut failing = among.iter().filter_map(|&dag| {
        let reason = reasons[dag].filter(own)?;
        let dag = dag_id(dag);
        Some(NotProven { dag, reason })
    });
    failing.next()
}

/// Fills in the bounds of the sinks of each DAG, in order, based on the bounds of jobs. A DAG is
/// not proven if one of its sinks has no bound within the sink's own deadline.
fn bound(case: &AnalysisInput<'_>, verdict: &mut AnalysisResult, bounds: &mut [Vec<Option<u64>>]) {
    let whole_ns = verdict.bounds.iter().map(|bound| Some((*bound)?.bound_ns));
    let responses: Vec<Option<u64>> = whole_ns.collect();
    let found = bound_sinks(case, &responses);
    for (dag, (&number, found_ns)) in case.members.iter().zip(found).enumerate() {
        let model = case.dag(dag);
        bounds[number] = found_ns;
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

/// Returns the longest path to each sink in nanoseconds, in the order of the sinks.
fn lengths_ns(task: &Task, model: &Dag) -> Vec<u64> {
    let finishes_ns = task.finishes_ns();
    let sinks = model.sinks().iter();
    sinks.map(|sink| finishes_ns[sink.index()]).collect()
}

/// Completes the bounds of a DAG's sinks by the bound of its jobs. Returns the first sink not
/// bounded by its deadline; in this case no sink gets a bound.
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

/// Returns the first sink whose longest path is longer than its deadline, and the path's length in
/// nanoseconds.
fn too_far(task: &Task, model: &Dag) -> Option<(SubtaskId, u64)> {
    let mut sinks = model.sinks().iter().copied().zip(lengths_ns(task, model));
    sinks.find(|&(sink, length_ns)| length_ns > model.subtask(sink).relative_deadline_ns())
}
