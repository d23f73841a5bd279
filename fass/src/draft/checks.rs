//! The checks of a commit that the model does not make: what DAGs use of DAGs that are not in it; the
//! functions that subtasks have for after faults; the inputs of a DAG from outside, which only sources
//! take, and each thing once, so that a job has one value of it; the modes; and whether what a DAG
//! records suffices for a replay, which calls no recorded source.
//!
//! The faults of modes, and of topics that are recorded, are asked only where there are some, so that
//! no other image has the code.

use alloc::format;
use alloc::rc::{Rc, Weak};
use alloc::string::{String, ToString};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::ptr;

use sched_dag::{DagId, DagLabel, OnFault, SubtaskSpec};

use super::DagDraft;
use super::fault::Fault;
use crate::run::effect::RequestTarget;
use crate::run::latest::AnyLatest;

/// Adds what is wrong with a DAG of these.
pub(crate) fn check_dag(
    drafts: &Drafts,
    draft: &DagDraft,
    label: &DagLabel,
    faults: &mut Vec<Fault>,
) {
    check_others(drafts, draft, label, faults);
    check_replaceable(draft, label, faults);
    check_waits(draft, label, faults);
    check_inputs(draft, label, faults);
}

/// Adds each use of something of a DAG that is not in the commit.
fn check_others(drafts: &Drafts, draft: &DagDraft, label: &DagLabel, faults: &mut Vec<Fault>) {
    for (subtask, latest, _) in &draft.samples {
        // The value's DAG has to be in this very commit, or nobody ever writes it.
        if writer_of(drafts, latest).is_none() {
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
    let asked = draft.devices.iter();
    let asked = asked.filter_map(|(subtask, device)| Some((*subtask, device.server()?)));
    let raises = raises.chain(of_faults.map(|signal| (0, signal)));
    for (subtask, signal) in raises.chain(asked) {
        if dag_of(drafts, signal).is_none() {
            let (dag, subtask) = (label.clone(), draft.label(subtask));
            faults.push(Fault::SignalNotCommitted { dag, subtask });
        }
    }
    for (subtask, target) in &draft.switches {
        if dag_of(drafts, target).is_none() {
            let (dag, subtask) = (label.clone(), draft.label(*subtask));
            faults.push(Fault::SwitchedNotCommitted { dag, subtask });
        }
    }
}

/// Adds what is wrong with the functions for after faults.
fn check_replaceable(draft: &DagDraft, label: &DagLabel, faults: &mut Vec<Fault>) {
    let dag = label.clone();
    let drops_jobs = draft.spec.on_fault != OnFault::EndDag;
    match draft.replaceable.first() {
        // It would be made anew after a fault that ends the DAG.
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
            // A fault may leave the state half changed, so somebody has to say what it begins with
            // again.
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

/// Adds what is wrong with waits: functions that cannot take them, and devices that several ask.
fn check_waits(draft: &DagDraft, dag: &DagLabel, faults: &mut Vec<Fault>) {
    for (number, subtask) in draft.spec.subtasks.iter().enumerate() {
        if subtask.waits.is_empty() || draft.waiting.contains(&number) {
            continue;
        }
        let (dag, subtask) = (dag.clone(), draft.label(number));
        faults.push(match draft.replaceable.contains(&number) {
            true => Fault::ReplaceableWaits { dag, subtask },
            false => Fault::CannotWait { dag, subtask },
        });
    }
    for (subtask, device) in &draft.asked_twice {
        faults.push(Fault::DeviceAskedTwice {
            dag: dag.clone(),
            subtask: draft.label(*subtask),
            device: device.clone(),
        });
    }
}

/// Adds what is wrong with the inputs from outside.
fn check_inputs(draft: &DagDraft, dag: &DagLabel, faults: &mut Vec<Fault>) {
    let mut add = |code, text| faults.push(Fault::Worded { code, text });
    for (number, (subtask, takes)) in draft.outside.iter().enumerate() {
        let label = draft.label(*subtask);
        let is_same =
            |(first, other): &&(usize, String)| other == takes && is_source(draft, *first);
        // A replay gives sources their values; what others take from outside it could not repeat.
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
fn is_source(draft: &DagDraft, subtask: usize) -> bool {
    let has_inputs = |spec: &SubtaskSpec| !spec.inputs.is_empty();
    let follows = |&(_, to): &(usize, usize)| to == subtask;
    let spec = &draft.spec;
    !spec.subtasks.get(subtask).is_some_and(has_inputs) && !spec.edges.iter().any(follows)
}

/// Adds what is wrong with the modes of a commit, and with what it records.
#[inline(never)]
pub(crate) fn check_all(drafts: &Drafts, faults: &mut Vec<Fault>) {
    let checks: [fn(&DagDraft) -> Option<Check>; 2] = [|of| of.check_modes, |of| of.check_recorded];
    for pick in checks {
        // A function pointer in the draft, so that an image without modes or recordings has no
        // code of them.
        if let Some(check) = drafts.iter().find_map(|draft| pick(&draft.borrow())) {
            check(drafts, faults);
        }
    }
}

/// A mode as stated so far.
pub(crate) struct ModeDraft {
    pub(crate) name: String,
    /// With the names that they had when the mode was made. A draft keeps its modes, so these do
    /// not keep it.
    pub(crate) dags: Vec<(Weak<RefCell<DagDraft>>, String)>,
}

/// The modes of one handle.
pub(crate) type ModeSets = Rc<RefCell<Vec<ModeDraft>>>;

/// All drafts of a commit.
pub(crate) type Drafts = [Rc<RefCell<DagDraft>>];

/// Adds all that is wrong with the modes of a commit, or with what it records.
pub(crate) type Check = fn(&Drafts, &mut Vec<Fault>);

/// Returns the DAGs of each mode of a commit.
pub(crate) fn dags_of_modes(drafts: &Drafts) -> Vec<Vec<DagId>> {
    let found = of_commit(drafts);
    let modes = found.first().map(|modes| modes.borrow());
    let id = |(dag, _): &(Weak<_>, _)| (0..).map(DagId).nth(dag_index(drafts, dag)?);
    let dags = |mode: &ModeDraft| mode.dags.iter().filter_map(id).collect();
    modes.map_or(Vec::new(), |modes| modes.iter().map(dags).collect())
}

/// Adds all that is wrong with the modes of a commit.
pub(crate) fn check_modes(drafts: &Drafts, faults: &mut Vec<Fault>) {
    let mut add = |code, text| faults.push(Fault::Worded { code, text });
    let found = of_commit(drafts);
    // Two sets of modes would switch the same DAGs without knowing of each other.
    if found.len() > 1 {
        let text = "the commit has modes of more than one `Modes`; make all of them by one";
        add("several_sets_of_modes", text.into());
    }
    for modes in &found {
        let modes = modes.borrow();
        for (number, mode) in modes.iter().enumerate() {
            let name = &mode.name;
            if modes[..number].iter().any(|other| other.name == *name) {
                let text = format!("two modes are called `{name}`; give each a name of its own");
                add("duplicate_mode", text);
            }
            let unknown = (mode.dags.iter()).filter(|(dag, _)| dag_index(drafts, dag).is_none());
            for (_, dag) in unknown {
                let text = format!(
                    "mode `{name}` has dag `{dag}`, which is not in the commit; commit all dags of \
                     its modes in one call"
                );
                add("mode_not_committed", text);
            }
        }
    }
    let modes = dags_of_modes(drafts);
    let in_some = |dag: DagId| modes.iter().any(|mode| mode.contains(&dag));
    for dag in (0..).map(DagId).take(drafts.len()) {
        let draft = drafts[dag.index()].borrow();
        if draft.starts_paused && in_some(dag) {
            let text = format!(
                "{} starts paused and is in a mode, and the first mode says what is paused at the \
                 start; drop `starts_paused`",
                label(drafts, dag)
            );
            add("mode_starts_paused", text);
        }
        // What brings about a safe state is on wherever the DAG is that may need it.
        let handler = draft.on_fault.as_ref();
        let handler = handler.and_then(|target| dag_of(drafts, target));
        // A handler in no mode is never paused by one.
        let Some(handler) = handler.filter(|&handler| in_some(handler)) else {
            continue;
        };
        let lacks =
            |mode: &Vec<DagId>| (mode.contains(&dag) || !in_some(dag)) && !mode.contains(&handler);
        if let Some(number) = modes.iter().position(lacks) {
            let text = format!(
                "a fault of {} releases {}, which is off in mode `{}`; add it to that mode, or to \
                 none",
                label(drafts, dag),
                label(drafts, handler),
                found[0].borrow()[number].name
            );
            add("mode_without_handler", text);
        }
    }
}

/// Returns the modes that a commit names, each handle once.
fn of_commit(drafts: &Drafts) -> Vec<ModeSets> {
    let mut found: Vec<ModeSets> = Vec::new();
    for draft in drafts {
        for modes in &draft.borrow().modes {
            // Each set once, however many DAGs name it.
            if !found.iter().any(|other| Rc::ptr_eq(other, modes)) {
                found.push(Rc::clone(modes));
            }
        }
    }
    found
}

/// Returns the place of a DAG in the commit.
fn dag_index(drafts: &Drafts, dag: &Weak<RefCell<DagDraft>>) -> Option<usize> {
    // By identity: names may be the same.
    let is_it = |draft: &Rc<_>| core::ptr::eq(Rc::as_ptr(draft), dag.as_ptr());
    drafts.iter().position(is_it)
}

/// Returns the DAG that is meant.
fn dag_of(drafts: &Drafts, target: &Arc<RequestTarget>) -> Option<DagId> {
    let is_it = |other: &Rc<RefCell<DagDraft>>| Arc::ptr_eq(&other.borrow().target, target);
    (0..).map(DagId).nth(drafts.iter().position(is_it)?)
}

/// Returns the position of the DAG whose topic a latest value is of.
pub(crate) fn writer_of(drafts: &Drafts, latest: &Rc<dyn AnyLatest>) -> Option<usize> {
    let is_it = |offered: &Rc<dyn AnyLatest>| ptr::addr_eq(Rc::as_ptr(offered), Rc::as_ptr(latest));
    (drafts.iter()).position(|draft| draft.borrow().latest.iter().any(is_it))
}

fn label(drafts: &Drafts, dag: DagId) -> DagLabel {
    let mut name = drafts[dag.index()].borrow().spec.name.clone();
    if name.is_empty() {
        name = dag.0.to_string();
    }
    DagLabel { id: dag, name }
}

/// Adds what the DAGs of a commit do not record that a replay would need: of each DAG a source
/// of which is recorded, all else that its sources write, and what its other subtasks sample.
pub(crate) fn check_recorded(drafts: &Drafts, faults: &mut Vec<Fault>) {
    let mut add = |code, text| faults.push(Fault::Worded { code, text });
    for (id, draft) in (0..).map(DagId).zip(drafts) {
        let draft = draft.borrow();
        let dag = label(drafts, id);
        let is_source = |subtask: usize| draft.spec.subtasks[subtask].inputs.is_empty();
        let sources = (0..draft.spec.subtasks.len()).filter(|subtask| is_source(*subtask));
        let written = sources.flat_map(|subtask| {
            let outputs = draft.spec.subtasks[subtask].outputs.iter();
            outputs.map(move |port| (subtask, &*port.topic))
        });
        let (recorded, others): (Vec<_>, Vec<_>) =
            written.partition(|(_, topic)| records(&draft, topic));
        let Some((_, first)) = recorded.first() else {
            continue;
        };
        for (subtask, topic) in others {
            let subtask = draft.label(subtask);
            let text = format!(
                "{subtask} of {dag} writes topic `{topic}`, which is not recorded, and a replay \
                 would not call it, for topic `{first}` of a source is; record all topics of the \
                 sources, or none"
            );
            add("source_partly_recorded", text);
        }
        let asks = draft.devices.iter();
        for (subtask, device) in asks.filter(|(subtask, _)| !is_source(*subtask)) {
            if device.line().is_none() {
                let (subtask, device) = (draft.label(*subtask), device.name());
                let text = format!(
                    "{subtask} of {dag} asks device `{device}`, whose answers are not recorded, and \
                     a replay could not give them, though topic `{first}` of a source is; record \
                     both, or neither"
                );
                add("answers_not_recorded", text);
            }
        }
        let samples = draft.samples.iter();
        for (subtask, latest, _) in samples.filter(|(subtask, ..)| !is_source(*subtask)) {
            let (subtask, topic) = (draft.label(*subtask), latest.topic());
            let writer = writer_of(drafts, latest);
            if writer.is_some_and(|writer| !records(&drafts[writer].borrow(), topic)) {
                let text = format!(
                    "{subtask} of {dag} samples topic `{topic}`, which is not recorded, and a \
                     replay could not give it the same, though topic `{first}` of a source is; \
                     record both, or neither"
                );
                add("sample_not_recorded", text);
            }
        }
    }
}

fn records(draft: &DagDraft, topic: &str) -> bool {
    let mut recorded = draft.recorded.iter();
    recorded.any(|recorded| recorded.topic() == topic)
}
