//! The life of a DAG, and how one does at an instant.

use super::{DagStatistics, Scheduler};
use crate::ids::DagId;

/// A phase of a DAG's life. A DAG is paused and goes on any number of times; it never comes back
/// from a later phase to an earlier one of the other two.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum DagPhase {
    /// It releases its jobs.
    Running,
    /// It skips its due jobs until it is resumed (P1 to P5).
    Paused,
    /// It releases no further job, and what is in flight goes on to its end (C1 to C5).
    Closed,
    /// A fault or a stop has ended it: nothing of it starts any more (E1 to E8).
    Ended,
}

/// A DAG at one instant.
#[derive(Clone, Copy, Debug)]
pub struct Snapshot {
    /// Its phase.
    pub phase: DagPhase,
    /// Whether it has a limit of jobs, and nothing of it is left to be done.
    pub is_over: bool,
    /// The fates of its jobs.
    pub statistics: DagStatistics,
    /// Jobs in flight.
    pub in_flight: u64,
    /// Due jobs that wait for an older one to end.
    pub waiting: u64,
}

impl Snapshot {
    /// Returns the word for its state that people and programs read.
    #[must_use]
    pub const fn word(&self) -> &'static str {
        match self.phase {
            DagPhase::Closed | DagPhase::Ended => "ended",
            _ if self.is_over => "over",
            DagPhase::Paused => "stopped",
            DagPhase::Running => "running",
        }
    }

    /// Reports whether it will release no further job, whatever comes.
    #[must_use]
    pub fn is_final(&self) -> bool {
        self.is_over || self.phase >= DagPhase::Closed
    }
}

impl Scheduler {
    /// Returns the phase of a DAG's life.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[must_use]
    #[inline]
    pub fn phase(&self, dag: DagId) -> DagPhase {
        self.dags[dag.index()].jobs.phase
    }

    /// Returns how a DAG does.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[must_use]
    pub fn snapshot(&self, dag: DagId) -> Snapshot {
        Snapshot {
            phase: self.phase(dag),
            is_over: self.is_over(dag) && self.task_set.dag(dag).jobs().is_some(),
            statistics: *self.statistics(dag),
            in_flight: self.in_flight(dag),
            waiting: self.waiting(dag),
        }
    }
}
