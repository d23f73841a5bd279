//! Parts of a draft: all statements of a DAG beyond its times, its subtasks and its edges, such as
//! devices, signals and modes.
//!
//! A part checks itself for faults, and ties itself to the plan. Both are in the file in `api` with
//! the app's call for the part. The commit finds the parts here, so the commit names few of them.
//!
//! A new part needs a file in `api` [adding](DagDraft::add) the part, and a row of [`PartKind`];
//! `lib.rs` exports the names needed by apps, and each fault of the part has a row in
//! `docs/errors.md`.

use alloc::boxed::Box;
use alloc::format;
use alloc::rc::Rc;
use alloc::string::ToString;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::any::Any;
use core::cell::RefCell;
use core::fmt::Display;

use sched_dag::{Dag, DagId, DagLabel, sorted_by_key};

use super::DagDraft;
use super::fault::Fault;
use crate::run::effect::{Effect, RequestTarget};
use crate::run::plan::{Plan, SubtaskCode};

/// The kinds of parts, in the order in which a commit reports their faults.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum PartKind {
    Sample,
    Raise,
    OnFault,
    Device,
    Switch,
    Replacement,
    State,
    Wait,
    SecondAsker,
    Input,
    Modes,
    Recording,
    Lifecycle,
    Effect,
}

/// A statement of a DAG.
pub(crate) trait DraftPart: Any {
    /// Returns the part's fault, if there is one.
    fn check(&self, _of: &CheckedDag<'_>) -> Option<Fault> {
        None
    }

    /// Ties the part to the bodies of its DAG, after the parts added before.
    fn tie(self: Box<Self>, _dag: &mut TiedDag<'_>) {}
}

/// All drafts of a commit.
pub(crate) type Drafts = [Rc<RefCell<DagDraft>>];

/// Adds the faults visible only from all DAGs of a commit together. Such a check is itself a part,
/// added by each DAG with a part of the kind.
pub(crate) type CommitCheck = fn(&Drafts, &mut Vec<Fault>);

/// Completes the plan of a commit, before the first DAG is closed and tied; a part like a
/// [`CommitCheck`].
pub(crate) type Planner = fn(&Drafts, &mut Plan);

type Tie = Box<dyn FnOnce(&mut TiedDag<'_>)>;

impl DraftPart for CommitCheck {}

impl DraftPart for Planner {}

/// A function looking for a fault is a part.
impl<F: Fn(&CheckedDag<'_>) -> Option<Fault> + 'static> DraftPart for F {
    fn check(&self, of: &CheckedDag<'_>) -> Option<Fault> {
        self(of)
    }
}

impl DraftPart for Tie {
    fn tie(self: Box<Self>, dag: &mut TiedDag<'_>) {
        self(dag);
    }
}

/// A DAG of a commit during the check.
pub(crate) struct CheckedDag<'c> {
    pub(crate) drafts: &'c Drafts,
    pub(crate) draft: &'c DagDraft,
    pub(crate) label: DagLabel,
}

/// A DAG with its bodies made.
pub(crate) struct TiedDag<'t> {
    pub(crate) verified: &'t Dag,
    pub(crate) target: &'t Arc<RequestTarget>,
    pub(crate) bodies: &'t mut Vec<SubtaskCode>,
    /// The DAG that gets a signal when a fault ends this DAG.
    pub(crate) after_fault: &'t mut Option<DagId>,
}

impl DagDraft {
    /// Adds a part.
    pub(crate) fn add(&mut self, kind: PartKind, part: impl DraftPart) {
        self.parts.push((kind, Box::new(part)));
    }

    /// Adds a part whose only work is tying.
    pub(crate) fn tie(&mut self, tie: impl FnOnce(&mut TiedDag<'_>) + 'static) {
        let tie: Tie = Box::new(tie);
        self.add(PartKind::Effect, tie);
    }

    /// Adds an effect of a subtask's completions. Effects happen in the order of registration.
    pub(crate) fn act(&mut self, subtask: usize, effect: Box<dyn Effect>) {
        self.tie(move |dag| dag.bodies[subtask].add_effects([effect]));
    }

    /// Returns the parts of a type.
    pub(crate) fn all<P: DraftPart>(&self) -> impl Iterator<Item = &P> {
        let parts = self.parts.iter();
        parts.filter_map(|(_, part)| (&**part as &dyn Any).downcast_ref())
    }

    /// Reports whether the draft has a part of a type.
    pub(crate) fn has<P: DraftPart>(&self) -> bool {
        self.all::<P>().next().is_some()
    }
}

impl CheckedDag<'_> {
    /// Adds the faults of the DAG's parts.
    pub(crate) fn check(&self, faults: &mut Vec<Fault>) {
        let parts = &self.draft.parts;
        let order = sorted_by_key(parts.len(), |number| parts[number].0);
        faults.extend(
            order
                .into_iter()
                .filter_map(|number| parts[number].1.check(self)),
        );
    }

    /// Returns a fault of a subtask.
    pub(crate) fn fault(&self, code: &'static str, subtask: usize, says: impl Display) -> Fault {
        let (dag, subtask) = (&self.label, self.draft.label(subtask));
        let text = format!("{subtask} of {dag} {says}");
        Fault::Worded { code, text }
    }
}

/// Returns a commit's parts of type `P`, one of each kind, in the order of the kinds.
pub(crate) fn one_of_each<P: DraftPart + Copy>(drafts: &Drafts) -> Vec<(PartKind, P)> {
    let mut found: Vec<(PartKind, P)> = Vec::new();
    for draft in drafts {
        for (kind, part) in &draft.borrow().parts {
            if let Some(part) = (&**part as &dyn Any).downcast_ref()
                && let Err(place) = found.binary_search_by_key(kind, |(of, _)| *of)
            {
                found.insert(place, (*kind, *part));
            }
        }
    }
    found
}

/// Returns the DAG identified by a target.
pub(crate) fn dag_of(drafts: &Drafts, target: &Arc<RequestTarget>) -> Option<DagId> {
    let is_it = |other: &Rc<RefCell<DagDraft>>| Arc::ptr_eq(&other.borrow().target, target);
    (0..).map(DagId).nth(drafts.iter().position(is_it)?)
}

/// Returns the name of a DAG in faults of a whole commit.
pub(crate) fn label(drafts: &Drafts, dag: DagId) -> DagLabel {
    let mut name = drafts[dag.index()].borrow().spec.name.clone();
    if name.is_empty() {
        name = dag.0.to_string();
    }
    DagLabel { id: dag, name }
}
