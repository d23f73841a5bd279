//! The modes that are stated before the commit, and what may be wrong with them; and whether what a
//! DAG records suffices for a replay, which calls no recorded source.

use alloc::format;
use alloc::rc::{Rc, Weak};
use alloc::string::{String, ToString};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::ptr;

use sched_dag::{DagId, DagLabel};

use super::Draft;
use crate::run::latest::AnyLatest;

/// A mode as stated so far.
pub(crate) struct ModeDraft {
    pub(crate) name: String,
    /// With the names that they had when the mode was made. A draft keeps its modes, so these do
    /// not keep it.
    pub(crate) dags: Vec<(Weak<RefCell<Draft>>, String)>,
}

/// The modes of one handle.
pub(crate) type Modes = Rc<RefCell<Vec<ModeDraft>>>;

/// All drafts of a commit.
type Drafts = [Rc<RefCell<Draft>>];

/// Takes a fault, by its code and its text.
type Add<'a> = &'a mut dyn FnMut(&'static str, String);

/// Reports all that is wrong with the modes of a commit, or with what it records.
pub(crate) type Check = fn(&Drafts, Add<'_>);

/// Returns the DAGs of each mode of a commit.
pub(crate) fn dags_of_modes(drafts: &Drafts) -> Vec<Vec<DagId>> {
    let found = of_commit(drafts);
    let modes = found.first().map(|modes| modes.borrow());
    let id = |(dag, _): &(Weak<_>, _)| (0..).map(DagId).nth(place(drafts, dag)?);
    let dags = |mode: &ModeDraft| mode.dags.iter().filter_map(id).collect();
    modes.map_or(Vec::new(), |modes| modes.iter().map(dags).collect())
}

/// Reports all that is wrong with the modes of a commit.
pub(crate) fn check_modes(drafts: &Drafts, add: Add<'_>) {
    let found = of_commit(drafts);
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
            let unknown = (mode.dags.iter()).filter(|(dag, _)| place(drafts, dag).is_none());
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
        let Some(handler) = handler(drafts, &draft).filter(|&handler| in_some(handler)) else {
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
fn of_commit(drafts: &Drafts) -> Vec<Modes> {
    let mut found: Vec<Modes> = Vec::new();
    for draft in drafts {
        for modes in &draft.borrow().modes {
            if !found.iter().any(|other| Rc::ptr_eq(other, modes)) {
                found.push(Rc::clone(modes));
            }
        }
    }
    found
}

/// Returns the place of a DAG in the commit.
fn place(drafts: &Drafts, dag: &Weak<RefCell<Draft>>) -> Option<usize> {
    let is_it = |draft: &Rc<_>| core::ptr::eq(Rc::as_ptr(draft), dag.as_ptr());
    drafts.iter().position(is_it)
}

/// Returns the DAG that a fault of another releases.
fn handler(drafts: &Drafts, draft: &Draft) -> Option<DagId> {
    let target = draft.on_fault.as_ref()?;
    let is_it = |other: &Rc<RefCell<Draft>>| Arc::ptr_eq(&other.borrow().target, target);
    (0..).map(DagId).nth(drafts.iter().position(is_it)?)
}

fn label(drafts: &Drafts, dag: DagId) -> DagLabel {
    let mut name = drafts[dag.index()].borrow().spec.name.clone();
    if name.is_empty() {
        name = dag.0.to_string();
    }
    DagLabel { id: dag, name }
}

/// Reports what the DAGs of a commit do not record that a replay would need: of each DAG a source
/// of which is recorded, all else that its sources write, and what its other subtasks sample.
pub(crate) fn check_recorded(drafts: &Drafts, add: Add<'_>) {
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
        let samples = draft.samples.iter();
        for (subtask, latest, _) in samples.filter(|(subtask, ..)| !is_source(*subtask)) {
            let (subtask, topic) = (draft.label(*subtask), latest.topic());
            let offers = |other: &Draft| other.latest.iter().any(|own| is_same(own, latest));
            let mut others = drafts.iter().map(|other| other.borrow());
            if others.any(|other| offers(&other) && !records(&other, topic)) {
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

fn records(draft: &Draft, topic: &str) -> bool {
    let mut recorded = draft.recorded.iter();
    recorded.any(|recorded| recorded.topic() == topic)
}

fn is_same(one: &Rc<dyn AnyLatest>, other: &Rc<dyn AnyLatest>) -> bool {
    ptr::addr_eq(Rc::as_ptr(one), Rc::as_ptr(other))
}
