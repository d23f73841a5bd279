//! The checks of a commit that the model does not make: what DAGs use of DAGs that are not in it; the
//! functions that subtasks have for after faults; the inputs of a DAG from outside, which only sources
//! take, and each thing once, so that a job has one value of it.
//!
//! The faults of modes, and of topics that are recorded, are asked only where there are some, so that
//! no other image has the code.

use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;

use sched_dag::{DagLabel, OnFault, SubtaskSpec};

use super::staleness::writer_of;
use super::tie::drafts;
use crate::api::dag::Dag;
use crate::draft::Draft;
use crate::draft::checks::Check;
use crate::draft::fault::Fault;
use crate::run::effect::Target;

/// Adds what is wrong with a DAG of these.
pub(super) fn check_dag(dags: &[Dag], draft: &Draft, label: &DagLabel, faults: &mut Vec<Fault>) {
    check_others(dags, draft, label, faults);
    check_replaceable(draft, label, faults);
    check_inputs(draft, label, faults);
}

/// Adds each use of something of a DAG that is not in the commit.
fn check_others(dags: &[Dag], draft: &Draft, label: &DagLabel, faults: &mut Vec<Fault>) {
    let is_there = |target: &Arc<Target>| {
        let mut others = dags.iter();
        others.any(|other| Arc::ptr_eq(target, &other.draft.borrow().target))
    };
    for (subtask, latest, _) in &draft.samples {
        if writer_of(dags, &**latest).is_none() {
            faults.push(Fault::LatestNotCommitted {
                dag: label.clone(),
                subtask: draft.label(*subtask),
                topic: latest.topic().into(),
            });
        }
    }
    // The fault of any subtask raises the DAG's; the first stands for them.
    let of_faults = draft.on_fault.iter().take(draft.spec.subtasks.len());
    let raises = draft
        .raises
        .iter()
        .map(|(subtask, signal)| (*subtask, signal));
    for (subtask, signal) in raises.chain(of_faults.map(|signal| (0, signal))) {
        if !is_there(signal) {
            let (dag, subtask) = (label.clone(), draft.label(subtask));
            faults.push(Fault::SignalNotCommitted { dag, subtask });
        }
    }
    for (subtask, target) in &draft.switches {
        if !is_there(target) {
            let (dag, subtask) = (label.clone(), draft.label(*subtask));
            faults.push(Fault::SwitchedNotCommitted { dag, subtask });
        }
    }
}

/// Adds what is wrong with the functions for after faults.
fn check_replaceable(draft: &Draft, label: &DagLabel, faults: &mut Vec<Fault>) {
    let dag = label.clone();
    let drops_jobs = draft.spec.on_fault != OnFault::EndDag;
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
}

/// Adds what is wrong with the inputs from outside.
fn check_inputs(draft: &Draft, dag: &DagLabel, faults: &mut Vec<Fault>) {
    let mut add = |code, text| faults.push(Fault::Worded { code, text });
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
}

/// Reports whether nothing precedes a subtask.
fn is_source(draft: &Draft, subtask: usize) -> bool {
    let has_inputs = |spec: &SubtaskSpec| !spec.inputs.is_empty();
    let follows = |&(_, to): &(usize, usize)| to == subtask;
    let spec = &draft.spec;
    !spec.subtasks.get(subtask).is_some_and(has_inputs) && !spec.edges.iter().any(follows)
}

/// Adds what is wrong with the modes of a commit, and with what it records.
#[inline(never)]
pub(super) fn check_all(dags: &[Dag], faults: &mut Vec<Fault>) {
    let checks: [fn(&Draft) -> Option<Check>; 2] = [|of| of.check_modes, |of| of.check_recorded];
    for pick in checks {
        if let Some(check) = dags.iter().find_map(|dag| pick(&dag.draft.borrow())) {
            check(&drafts(dags), &mut |code, text| {
                faults.push(Fault::Worded { code, text });
            });
        }
    }
}
