//! The key of an instance (R5).
//!
//! It is absolute: fixed when the instance becomes ready from things fixed at
//! its job's release, and the same in every comparison, whether the instances
//! wait or run. It ends in the instance's own numbers, so no two are equal.

use crate::ids::{DagId, Instance, SubtaskId};

/// An instance's place in the order of dispatch; the smaller key goes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Key {
    /// The priority's number, or the rank that stands for it; or the absolute
    /// deadline in nanoseconds.
    urgency: u64,
    dag: DagId,
    job: u64,
    subtask: SubtaskId,
}

impl Key {
    /// Fills places that hold no key.
    pub(super) const NONE: Self = Self {
        urgency: u64::MAX,
        dag: DagId(0),
        job: 0,
        subtask: SubtaskId(0),
    };

    pub(super) const fn new(urgency: u64, instance: Instance) -> Self {
        let Instance { dag, job, subtask } = instance;
        Self {
            urgency,
            dag,
            job,
            subtask,
        }
    }

    pub(super) const fn urgency(self) -> u64 {
        self.urgency
    }

    pub(super) const fn instance(self) -> Instance {
        let Self {
            dag, job, subtask, ..
        } = self;
        Instance { dag, job, subtask }
    }
}
