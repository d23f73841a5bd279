//! Serves requests: which DAGs rest, and the end of the run.

use alloc::vec::Vec;

use super::{Change, Lifecycle, Request};
use crate::ids::DagId;

/// What an app states of its run's life, and how far that has come.
#[derive(Clone, Debug, Default)]
pub struct Changes {
    /// The DAGs of the plan that requests may touch.
    dags: Vec<DagId>,
    /// Those that are paused from the beginning on.
    paused: Vec<DagId>,
    may_shut_down: bool,
}

impl Changes {
    /// Makes it for a plan of so many DAGs.
    #[must_use]
    pub fn new(dags: u32, may_shut_down: bool) -> Self {
        Self {
            dags: (0..dags).map(DagId).collect(),
            paused: Vec::new(),
            may_shut_down,
        }
    }

    /// Lets DAGs be paused from the beginning on (L4).
    #[must_use]
    pub fn with_paused(self, paused: Vec<DagId>) -> Self {
        Self { paused, ..self }
    }

    fn touches(&self, dag: DagId) -> bool {
        self.dags.contains(&dag)
    }
}

impl Lifecycle for Changes {
    fn serve(&mut self, request: Request, changes: &mut Vec<Change>) {
        match request {
            Request::Begin => changes.extend(self.paused.drain(..).map(Change::Pause)),
            Request::Pause(dag) if self.touches(dag) => changes.push(Change::Pause(dag)),
            Request::Resume(dag) if self.touches(dag) => changes.push(Change::Resume(dag)),
            Request::ShutDown => changes.extend(self.dags.drain(..).map(Change::Close)),
            Request::Signal(_) | Request::Pause(_) | Request::Resume(_) => {}
        }
    }

    fn leave_alone(&mut self, dag: DagId) {
        self.dags.retain(|&other| other != dag);
        self.paused.retain(|&other| other != dag);
    }

    fn add(&mut self, dag: DagId) {
        self.dags.push(dag);
    }

    fn may_shut_down(&self) -> bool {
        self.may_shut_down
    }
}
