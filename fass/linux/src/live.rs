//! A run while it goes on, for those who show it to a person.

use std::fmt;
use std::sync::{Arc, PoisonError, RwLock};

use fass::edge::Seen;
use sched_dag::lifecycle::Request;
use sched_dag::{DagId, Journal, Snapshot, TaskSet};

use crate::edge;
use crate::level::Role;
use crate::office::Office;
use crate::sys;
use crate::team::Team;

/// What goes on.
static LIVE: RwLock<Option<Live>> = RwLock::new(None);

/// A run that goes on.
///
/// A thread that asks it something takes a cluster's lock for a moment, so it has to be one that
/// nobody preempts meanwhile: [`raise`](Self::raise).
///
/// ```
/// assert!(linux::Live::get().is_none()); // nothing runs
/// ```
#[derive(Clone)]
pub struct Live {
    office: Arc<Office>,
    /// By cluster.
    teams: Arc<[Arc<Team>]>,
}

impl Live {
    /// Returns the run that goes on, if one does.
    #[must_use]
    pub fn get() -> Option<Self> {
        LIVE.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    pub(crate) fn begin(office: &Arc<Office>, teams: &[Arc<Team>]) -> Self {
        let live = Self {
            office: Arc::clone(office),
            teams: teams.into(),
        };
        *LIVE.write().unwrap_or_else(PoisonError::into_inner) = Some(live.clone());
        live
    }

    pub(crate) fn end() {
        *LIVE.write().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Returns the time on the clock, whatever functions are told.
    #[must_use]
    pub fn now_ns() -> u64 {
        sys::now_ns()
    }

    /// Puts the calling thread before all that compute.
    pub fn raise(&self) {
        if let Some(levels) = self.office.levels {
            levels.bring(sys::thread(), Role::Release);
        }
    }

    /// Puts it behind them again.
    pub(crate) fn lower(&self) {
        if let Some(levels) = self.office.levels {
            levels.bring(sys::thread(), Role::Abandoned);
        }
    }

    /// Returns the model.
    #[must_use]
    pub fn task_set(&self) -> &Arc<TaskSet> {
        &self.office.task_set
    }

    /// Returns the number of clusters.
    #[must_use]
    pub fn clusters(&self) -> usize {
        self.teams.len()
    }

    /// Returns how a DAG does.
    #[must_use]
    pub fn snapshot(&self, dag: DagId) -> Option<Snapshot> {
        let cluster = self.task_set().dags().get(dag.index())?.cluster();
        let state = self.teams.get(cluster.index())?.lock();
        Some(state.engine.scheduler.snapshot(dag))
    }

    /// Makes a change to a DAG.
    pub fn change(&self, dag: DagId, change: fn(DagId) -> Request) {
        self.office.send(None, change(dag));
    }

    /// Has nothing more released, and what is in flight go on to its end.
    pub fn close(&self) {
        self.office.send_of_all(Request::Close);
    }

    /// Looks at the journal of a cluster, shortly, or changes what it records.
    pub fn with_journal<R>(
        &self,
        cluster: usize,
        look: impl FnOnce(&mut Journal) -> R,
    ) -> Option<R> {
        let mut state = self.teams.get(cluster)?.lock();
        Some(look(&mut state.engine.scheduler.log.journal))
    }

    /// Has the values of a topic kept to be seen, or none; reports whether it is recorded.
    pub fn watch(&self, topic: Option<&str>) -> bool {
        edge::get().watch(topic)
    }

    /// Takes the latest value that is to be seen, if there is a new one.
    pub fn take_seen(&self, into: &mut [u8]) -> Option<Seen> {
        edge::get().take_seen(into)
    }
}

impl fmt::Debug for Live {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Live").finish_non_exhaustive()
    }
}
