//! The names of DAGs and subtasks in messages.
//!
//! A *label* is an id together with the name given by the app. Its text is "subtask `fuse`", or
//! "subtask 3" if the app gave no name.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt::{self, Display};
use core::time::Duration;

use crate::ids::{DagId, SubtaskId, named};
use crate::spec::DagSpec;
use crate::task_set::TaskSet;

/// A DAG, as messages name it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct DagLabel {
    /// The DAG.
    pub id: DagId,
    /// Its name, or nothing.
    pub name: String,
}

/// A subtask, as messages name it.
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
    /// Returns the label of a DAG for messages.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    pub fn label(&self, id: DagId) -> DagLabel {
        let name = self.dag(id).name().into();
        DagLabel { id, name }
    }

    /// Returns the label of a subtask for messages.
    ///
    /// # Panics
    ///
    /// If there is no such subtask.
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

/// Returns an index as an id's number. A count beyond `u32` is a separate fault, so a label with
/// `u32::MAX` never appears alone.
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

/// The maximum number of subtasks listed in a message, before it only counts the rest.
const LISTED: usize = 8;

/// Returns a time in the form printed by messages.
pub(super) const fn ns(ns: u64) -> Duration {
    Duration::from_nanos(ns)
}

/// Returns the text before the remedy: the question whether another topic was meant.
pub(super) fn question(meant: Option<&String>) -> impl Display {
    fmt::from_fn(move |f| match meant {
        Some(topic) => write!(f, "did you mean `{topic}`? If not, "),
        None => Ok(()),
    })
}

/// Returns the labels with commas between them, at most [`LISTED`].
pub(super) fn list<L: Display>(labels: &[L]) -> String {
    use core::fmt::Write;

    let mut text = String::new();
    for (position, label) in labels.iter().take(LISTED).enumerate() {
        let separator = if position == 0 { "" } else { ", " };
        // Writing to a `String` cannot fail.
        let _ = write!(text, "{separator}{label}");
    }
    if labels.len() > LISTED {
        let _ = write!(text, " and {} more", labels.len() - LISTED);
    }
    text
}

/// Returns subtasks of several DAGs in the form printed by a list.
pub(super) fn members(subtasks: &[(DagLabel, SubtaskLabel)]) -> Vec<String> {
    let named = |(dag, subtask): &(DagLabel, SubtaskLabel)| format!("{subtask} of {dag}");
    subtasks.iter().map(named).collect()
}

/// Returns a cycle's subtasks, and the first one again.
pub(super) fn ring(hops: &[SubtaskLabel]) -> impl Display {
    fmt::from_fn(move |f| {
        for hop in hops {
            write!(f, "{hop} -> ")?;
        }
        hops.first().map_or(Ok(()), |first| first.fmt(f))
    })
}

/// Returns how a subtask precedes itself, and the remedy.
pub(super) fn own_input(topic: Option<&String>) -> impl Display {
    fmt::from_fn(move |f| match topic {
        Some(topic) => write!(
            f,
            "reads topic `{topic}`, which it writes itself; keep the value in the subtask's own \
             state"
        ),
        None => f.write_str("precedes itself; remove the edge"),
    })
}

/// Returns words for the clusters that can be stated, out of `clusters` clusters.
pub(super) fn one_up_to(clusters: usize) -> impl Display {
    fmt::from_fn(move |f| write!(f, "state one up to cluster {}", clusters.saturating_sub(1)))
}

/// Returns words for the cores that can be stated in a cluster of `cores` cores.
pub(super) fn counted_from_0(cores: u32) -> impl Display {
    fmt::from_fn(move |f| {
        write!(
            f,
            "its cluster has {cores}, counted from 0; state one of these"
        )
    })
}

/// Returns why a cluster does not exist where there are `clusters`, and the remedy.
pub(super) fn undivided(clusters: usize) -> impl Display {
    fmt::from_fn(move |f| match clusters {
        0 => f.write_str("this machine's cores are not divided; leave its cluster out"),
        _ => write!(f, "there is none; {}", one_up_to(clusters)),
    })
}
