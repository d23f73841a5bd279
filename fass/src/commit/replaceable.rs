//! Checks the functions that subtasks have for after faults.

use alloc::vec::Vec;

use sched_dag::{DagLabel, OnFault};

use super::fault::Fault;
use crate::draft::Draft;

/// Returns what is wrong with these functions of a DAG.
pub(super) fn check(draft: &Draft, label: &DagLabel) -> Vec<Fault> {
    let dag = label.clone();
    let drops_jobs = draft.spec.on_fault != OnFault::EndDag;
    let mut faults = Vec::new();
    match draft.replaceable.first() {
        Some(&subtask) if !drops_jobs => faults.push(Fault::ReplacedInVain {
            dag,
            subtask: draft.label(subtask),
        }),
        None if drops_jobs => faults.push(Fault::NothingReplaceable { dag }),
        _ => {}
    }
    for (position, state) in draft.spec.states.iter().enumerate() {
        let mut users = state.users.iter().map(|user| user.subtask);
        if let Some(subtask) = users.find(|user| draft.replaceable.contains(user))
            && draft.resets.iter().all(|(state, _)| *state != position)
        {
            faults.push(Fault::StateWithoutReset {
                dag: label.clone(),
                subtask: draft.label(subtask),
                state: state.name.clone(),
            });
        }
    }
    faults
}
