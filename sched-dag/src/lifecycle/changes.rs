//! Serves requests: which DAGs rest, which mode runs, and the end of the run.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::modes::Modes;
use super::{Change, Entry, Lifecycle, Request};
use crate::ids::{DagId, ModeId};

/// What an app states of its run's life, and how far that has come.
#[derive(Clone, Debug, Default)]
pub struct Changes {
    /// The DAGs of the plan that requests may touch.
    dags: Vec<DagId>,
    /// Those that are paused from the beginning on.
    paused: Vec<DagId>,
    modes: Modes,
    may_shut_down: bool,
    /// How many DAGs the plan has.
    count: usize,
}

impl Changes {
    /// Makes it for a plan of so many DAGs.
    #[must_use]
    pub fn new(dags: u32, may_shut_down: bool) -> Self {
        Self {
            dags: (0..dags).map(DagId).collect(),
            may_shut_down,
            count: dags as usize,
            ..Self::default()
        }
    }

    /// Lets DAGs be paused from the beginning on (L4).
    #[must_use]
    pub fn with_paused(self, paused: Vec<DagId>) -> Self {
        Self { paused, ..self }
    }

    /// States the DAGs of each mode, by their numbers; the run begins in the first one (M1).
    #[must_use]
    pub fn with_modes(self, modes: Vec<Vec<DagId>>) -> Self {
        Self {
            modes: Modes::new(modes),
            ..self
        }
    }

    fn touches(&self, dag: DagId) -> bool {
        self.dags.contains(&dag)
    }
}

impl Lifecycle for Changes {
    fn serve(&mut self, request: Request, changes: &mut Vec<Change>) {
        match request {
            Request::Begin => {
                changes.extend(self.paused.drain(..).map(Change::Pause));
                self.modes.ask(ModeId(0), Entry::AtOnce, changes);
            }
            Request::GoOn => self.modes.go_on(changes),
            Request::Enter(mode, entry) => self.modes.ask(mode, entry, changes),
            Request::Pause(dag) if self.touches(dag) => changes.push(Change::Pause(dag)),
            Request::Resume(dag) if self.touches(dag) => changes.push(Change::Resume(dag)),
            Request::ShutDown => {
                self.modes = Modes::default();
                changes.extend(self.dags.drain(..).map(Change::Close));
            }
            // Of one DAG, and touching none of its own.
            Request::Pause(_)
            | Request::Resume(_)
            | Request::Signal(_)
            | Request::Close(_)
            | Request::Stop(_)
            | Request::Step => {}
        }
    }

    fn leave_alone(&mut self, dag: DagId) {
        self.dags.retain(|&other| other != dag);
        self.paused.retain(|&other| other != dag);
        self.modes.leave_alone(dag);
    }

    fn dags_of_modes(&self) -> Vec<DagId> {
        self.modes.dags().collect()
    }

    fn part(&self, is_here: &dyn Fn(DagId) -> bool, has_modes: bool) -> Box<dyn Lifecycle> {
        let here = |dags: &[DagId]| dags.iter().copied().filter(|dag| is_here(*dag)).collect();
        Box::new(Self {
            dags: here(&self.dags),
            paused: here(&self.paused),
            modes: match has_modes {
                true => self.modes.clone(),
                false => Modes::default(),
            },
            ..*self
        })
    }

    fn may_shut_down(&self) -> bool {
        self.may_shut_down
    }

    fn room(&self) -> (usize, usize) {
        // A pause and a resumption of each DAG, both ways into each mode, and those that there are
        // one of: the beginning, going on, the end.
        let kinds = 2 * self.count + 2 * self.modes.count() + 3;
        // At the beginning: what is paused, what the first mode changes, and that it is entered. A
        // mode pauses DAGs, awaits them, resumes others, and is entered.
        (kinds, 2 * self.count + 1)
    }
}
