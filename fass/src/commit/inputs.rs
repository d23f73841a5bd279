//! The inputs of a DAG from outside: only sources take it, and each thing once, so that a job has
//! one value of it.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use sched_dag::{DagLabel, SubtaskSpec};

use super::fault::Fault;
use crate::draft::Draft;
use crate::draft::flaw::WordedFault;

/// Returns what is wrong with the inputs of a DAG.
pub(super) fn check(draft: &Draft, dag: &DagLabel) -> Vec<Fault> {
    let mut faults = Vec::new();
    let mut add = |code, text| faults.push(Fault::Worded(WordedFault { code, text }));
    for (number, (subtask, takes)) in draft.outside.iter().enumerate() {
        let label = draft.label(*subtask);
        let is_same =
            |(first, other): &&(usize, String)| other == takes && is_source(draft, *first);
        if !is_source(draft, *subtask) {
            let text = format!(
                "{label} of {dag} is no source and {takes}; let the source do that, and send it \
                 along an edge"
            );
            add("taken_by_no_source", text);
        } else if let Some((first, _)) = draft.outside[..number].iter().find(is_same) {
            let first = draft.label(*first);
            let text = format!(
                "{label} of {dag} {takes}, and so does {first}, but a job has one value of it; let \
                 one source do that, once, and send it along edges"
            );
            add("taken_twice", text);
        }
    }
    faults
}

/// Reports whether nothing precedes a subtask.
fn is_source(draft: &Draft, subtask: usize) -> bool {
    let has_inputs = |spec: &SubtaskSpec| !spec.inputs.is_empty();
    let follows = |&(_, to): &(usize, usize)| to == subtask;
    let spec = &draft.spec;
    !spec.subtasks.get(subtask).is_some_and(has_inputs) && !spec.edges.iter().any(follows)
}
