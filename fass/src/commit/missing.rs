//! What DAGs of a commit use of DAGs that are not in it.

use alloc::sync::Arc;
use alloc::vec::Vec;

use sched_dag::DagLabel;

use super::fault::Fault;
use super::staleness::writer_of;
use crate::api::dag::Dag;
use crate::run::signal::Target;

/// Returns a fault for each use of something of a DAG that is not in the commit.
pub(super) fn others(dags: &[Dag], dag: &Dag, label: &DagLabel) -> Vec<Fault> {
    let draft = dag.draft.borrow();
    let samples = draft.samples.iter();
    let not_there = samples.filter(|(_, latest, _)| writer_of(dags, &**latest).is_none());
    let latest = not_there.map(|(subtask, latest, _)| Fault::LatestNotCommitted {
        dag: label.clone(),
        subtask: draft.label(*subtask),
        topic: latest.topic().into(),
    });
    let is_target =
        |signal: &Arc<Target>, other: &Dag| Arc::ptr_eq(signal, &other.draft.borrow().target);
    // The fault of any subtask raises the DAG's; the first stands for them.
    let of_faults = draft.on_fault.iter().take(draft.spec.subtasks.len());
    let of_faults = of_faults.map(|signal| (0, Arc::clone(signal)));
    let raises = draft.raises.iter().cloned().chain(of_faults);
    let unknown = raises.filter(|(_, signal)| !dags.iter().any(|other| is_target(signal, other)));
    let signals = unknown.map(|(subtask, _)| Fault::SignalNotCommitted {
        dag: label.clone(),
        subtask: draft.label(subtask),
    });
    let switches = draft.switches.iter();
    let unknown = switches.filter(|(_, target)| !dags.iter().any(|other| is_target(target, other)));
    let switched = unknown.map(|(subtask, _)| Fault::SwitchedNotCommitted {
        dag: label.clone(),
        subtask: draft.label(*subtask),
    });
    latest.chain(signals).chain(switched).collect()
}
