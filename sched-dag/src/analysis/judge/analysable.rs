//! Which DAGs can be analysed, and why others cannot.

use alloc::vec::Vec;

use super::dag_id;
use crate::analysis::answer::{NotProven, Reason, Settings};
use crate::analysis::relation::Relation;
use crate::analysis::task::{Task, TaskError};
use crate::task_set::Dag;

/// Returns the DAGs at the positions `own` as the analysis sees them, and notes for each that
/// cannot be analysed the reason: its own, or that it may have to wait for such a one.
pub(super) fn analysable(
    dags: &[Dag],
    own: &[usize],
    relation: &Relation,
    settings: &Settings,
    reasons: &mut [Option<Reason>],
) -> Vec<Option<Task>> {
    let overhead = settings.overheads.of_an_instance_ns(settings.preemption);
    let mut tasks: Vec<Option<Task>> = dags.iter().map(|_| None).collect();
    for &dag in own {
        let task = overhead
            .ok_or(TaskError::VolumeOverflow)
            .and_then(|overhead_ns| Task::from_dag(&dags[dag], overhead_ns));
        reasons[dag] = match &task {
            _ if settings.cores == 0 => Some(Reason::NoCores),
            Ok(_) => None,
            Err(error) => Some(Reason::Unknown(*error)),
        };
        tasks[dag] = task.ok();
    }
    let (mut known, mut unknown): (Vec<usize>, Vec<usize>) =
        own.iter().partition(|&&dag| reasons[dag].is_none());
    let mut seen = 0;
    while let Some(&other) = unknown.get(seen) {
        seen += 1;
        known.retain(|&dag| {
            let is_delayed = relation.may_delay(other, dag);
            if is_delayed {
                reasons[dag] = Some(Reason::DelayedBy { dag: dag_id(other) });
                unknown.push(dag);
            }
            !is_delayed
        });
    }
    tasks
}

/// Returns the first DAG at the positions `among` that cannot be analysed for a reason of its own.
pub(super) fn first_unknown(among: &[usize], reasons: &[Option<Reason>]) -> Option<NotProven> {
    let own = |reason: &Reason| !matches!(reason, Reason::DelayedBy { .. });
    let mut unknown = among.iter().filter_map(|&dag| {
        let reason = reasons[dag].filter(own)?;
        let dag = dag_id(dag);
        Some(NotProven { dag, reason })
    });
    unknown.next()
}
