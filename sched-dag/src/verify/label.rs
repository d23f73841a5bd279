//! How messages name DAGs and subtasks.
//!
//! A *label* is an id together with the name that the app gave. Its text is
//! "subtask `fuse`", or "subtask 3" if the app gave no name.

use alloc::string::String;
use core::fmt;

use crate::ids::{DagId, SubtaskId, named};
use crate::spec::DagSpec;
use crate::task_set::TaskSet;

/// A DAG as messages name it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct DagLabel {
    /// The DAG.
    pub id: DagId,
    /// Its name, or nothing.
    pub name: String,
}

/// A subtask as messages name it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct SubtaskLabel {
    /// The subtask.
    pub id: SubtaskId,
    /// Its name, or nothing.
    pub name: String,
}

impl DagLabel {
    pub(super) fn new(specs: &[&DagSpec], dag: usize) -> Self {
        Self {
            id: DagId(saturating_u32(dag)),
            name: specs[dag].name.clone(),
        }
    }
}

impl TaskSet {
    /// Returns a DAG as messages name it.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[must_use]
    pub fn label(&self, id: DagId) -> DagLabel {
        let name = self.dag(id).name().into();
        DagLabel { id, name }
    }

    /// Returns a subtask as messages name it.
    ///
    /// # Panics
    ///
    /// If there is no such subtask.
    #[must_use]
    pub fn subtask_label(&self, dag: DagId, id: SubtaskId) -> SubtaskLabel {
        let name = self.dag(dag).subtask(id).name().into();
        SubtaskLabel { id, name }
    }
}

impl SubtaskLabel {
    pub(super) fn new(spec: &DagSpec, subtask: usize) -> Self {
        Self {
            id: SubtaskId(saturating_u32(subtask)),
            name: spec.subtasks[subtask].name.clone(),
        }
    }
}

/// Returns an index as an id's number. A count that does not fit is a fault of
/// its own, so a label with `u32::MAX` never stands alone.
fn saturating_u32(index: usize) -> u32 {
    u32::try_from(index).unwrap_or(u32::MAX)
}

impl fmt::Display for DagLabel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        named("dag", self.id.0, &self.name).fmt(f)
    }
}

impl fmt::Display for SubtaskLabel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        named("subtask", self.id.0, &self.name).fmt(f)
    }
}
