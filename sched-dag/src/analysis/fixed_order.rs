//! Precedence that fixes an order of a DAG's subtasks, where that proves a shorter bound.
//!
//! Take a schedule of the WCETs on the cores of the DAG's cluster ([`ListSchedule`]): always the
//! ready subtask with the longest remaining path first, and none preempted. Add an edge from each
//! subtask to the next one on its core. Each core's subtasks are then a chain, so the DAG is no
//! wider than the cores; alone, no ready subtask ever waits, and the response time is at most the
//! length of the new graph: that of the schedule. Where subtasks can be pinned, each is to its core
//! of the schedule, if the answer is better with that; then it is so among others, too. Shorter execution times make no difference to
//! that, as they would to the schedule.
//!
//! Among others that can be worse: the path is longer, and what interferes with it may come
//! on one core. So the edges are added where the answer with them is better for the DAG and no
//! worse for any other, which takes an answer more for each DAG whose schedule is shorter than
//! the bound of one job alone. A DAG of which sinks have deadlines of their own stays as it is,
//! as the schedule knows none, and an edge would hand an early one on.
//!
//! The waits of subtasks are scheduled as if they were executed: a bound of that is one of the DAG.

use alloc::vec;
use alloc::vec::Vec;

use super::judge::answer;
use super::list_schedule::ListSchedule;
use super::multi_path::multi_path;
use super::task::Task;
use super::{AnalysisResult, AnalysisSettings};
use crate::ids::{DagId, to_u32};
use crate::policy::SubtaskOrder;
use crate::task_set::{Dag, TaskSet};

/// Fixes the order of each DAG that allows it, where that proves more: a shorter bound of it,
/// and of no other job or sink a longer one.
pub fn fix_orders(task_set: &mut TaskSet, settings: &AnalysisSettings) {
    let overhead_ns = settings.overheads.of_an_instance_ns(settings.preemption);
    let Some(overhead_ns) = overhead_ns else {
        return;
    };
    let mut free = None;
    for dag in (0..).map(DagId).take(task_set.dags().len()) {
        let model = task_set.dag(dag);
        let cores = to_u32(task_set.cores_of(model.cluster(), settings.cores).len());
        let schedule = match Task::from_dag(model, overhead_ns) {
            Ok(task) if allows(model) => shorter(&task, cores),
            _ => None,
        };
        let Some(schedule) = schedule else {
            continue;
        };
        let mut best = free.take().unwrap_or_else(|| answer(task_set, settings));
        // On a core of its own each subtask also keeps off what shares the cluster.
        let pinned = schedule.places();
        for cores in [&pinned[..], &[]] {
            let mut order = task_set.ordered(dag, &schedule.edges(), cores);
            task_set.exchange(dag, &mut order);
            let after = answer(task_set, settings);
            if is_better(dag, &after, &best) {
                best = after;
                break;
            }
            task_set.exchange(dag, &mut order);
        }
        // The answer is kept for the next DAG: an analysis of all is the dear part of this loop.
        free = Some(best);
    }
}

/// Reports whether an order of a DAG's subtasks may be fixed.
pub(super) fn allows(dag: &Dag) -> bool {
    let is_free = !dag.is_confined();
    is_free
        && dag.order == SubtaskOrder::Fixed
        && dag.least_deadline_ns() == dag.relative_deadline_ns()
}

/// Returns a schedule that is shorter than the bound of one job alone.
pub(super) fn shorter(task: &Task, cores: u32) -> Option<ListSchedule> {
    let limit_ns = multi_path(task, cores)?.checked_sub(1)?;
    let count = task.subtask_count().min(cores as usize);
    ListSchedule::within(task.oblivious(), &vec![limit_ns; count])
}

/// Compares answers: one DAG is to have a shorter bound, and no other a longer one, nor a sink
/// of these.
fn is_better(dag: DagId, after: &AnalysisResult, before: &AnalysisResult) -> bool {
    // What is not proven is longer than all that is.
    let bounds = |answer: &AnalysisResult| -> Vec<u64> {
        let jobs = answer.bounds.iter().map(|bound| Some((*bound)?.bound_ns));
        let (earlier, own_on) = answer.sinks_ns.split_at(dag.index());
        let sinks = earlier.iter().chain(&own_on[1..]).flatten().copied();
        jobs.chain(sinks).map(|ns| ns.unwrap_or(u64::MAX)).collect()
    };
    let (after, before) = (bounds(after), bounds(before));
    after[dag.index()] < before[dag.index()] && after.iter().zip(&before).all(|(a, b)| a <= b)
}
