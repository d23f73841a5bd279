//! Modes: sets of DAGs, one of which runs.
//!
//! A *mode* is a set of DAGs that run together, such as those of a flight, or of a landing. A
//! DAG that is in some mode is *on* in its modes and off, that is paused, in the others; a
//! DAG that is in none runs in all. The rules, whose tests in `tests/modes.rs` bear their numbers:
//!
//! - **M1, what is on.** A run begins in mode 0. When a mode is entered, its DAGs are resumed;
//!   the others that are in some mode are paused by then, at that instant or before (P1 to
//!   P5). DAGs that are on in the old mode and in the new one notice nothing.
//! - **M2, at once.** The mode is entered at the instant of the request. What is in flight of the
//!   DAGs that leave goes on to its end, next to the jobs of those that join.
//! - **M3, when idle.** The DAGs that leave are paused at the request. The mode is entered at the
//!   first instant at which no job of them is in flight: after the completions of that
//!   instant, before its releases; at the request itself, if none is then. Until then the DAGs that
//!   join stay paused.
//! - **M4, the last one counts.** A request takes the place of one that has not come about, by
//!   whatever way it asks to be entered. The mode that is there may be asked for, too.
//! - **M5, what a person does.** A DAG that was paused or resumed at the console stays so until a
//!   mode is entered.
//! - **M6, those that are gone.** An ended DAG stays so; it keeps no mode waiting but by what is in
//!   flight. After a shutdown no mode is entered.
//! - **M7, replays.** A DAG whose inputs are recorded is neither paused nor resumed, and none waits for
//!   it (L6).
//!
//! A change costs a pause or a resumption of each DAG that is in some mode, in one step of the
//! scheduler; one that waits for idleness costs a look at these DAGs in each step until then.

use alloc::vec::Vec;

use super::System;
use crate::ids::{DagId, ModeId};

/// When a mode is entered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Entry {
    /// At the instant of the request (M2).
    AtOnce,
    /// When nothing is in flight of the DAGs that leave (M3).
    WhenIdle,
}

/// The modes of a run.
#[derive(Clone, Debug, Default)]
pub(super) struct Modes {
    /// The DAGs of each.
    modes: Vec<Vec<DagId>>,
    /// The DAGs that are in some mode.
    dags: Vec<DagId>,
    /// The mode that is to be entered when what leaves is idle.
    pending: Option<ModeId>,
}

impl Modes {
    /// Begins in the first one, if there are any.
    pub(super) fn new(modes: Vec<Vec<DagId>>) -> Self {
        let mut dags: Vec<DagId> = modes.iter().flatten().copied().collect();
        dags.sort_unstable();
        dags.dedup();
        Self {
            pending: modes.first().map(|_| ModeId(0)),
            modes,
            dags,
        }
    }

    pub(super) fn count(&self) -> usize {
        self.modes.len()
    }

    /// Asks for a mode; reports whether it is still to be entered.
    pub(super) fn ask(&mut self, mode: ModeId, entry: Entry, system: &mut dyn System) -> bool {
        let leaving = leaving(&self.dags, &self.modes[mode.index()]);
        leaving.for_each(|dag| system.pause(dag));
        self.pending = Some(mode);
        match entry {
            Entry::AtOnce => self.enter(system),
            Entry::WhenIdle => return self.go_on(system),
        }
        false
    }

    /// Enters the mode that was asked for, if what leaves is idle; reports whether it is still to
    /// be entered.
    pub(super) fn go_on(&mut self, system: &mut dyn System) -> bool {
        let Some(mode) = self.pending else {
            return false;
        };
        let mut leaving = leaving(&self.dags, &self.modes[mode.index()]);
        let waits = leaving.any(|dag| system.in_flight(dag) > 0);
        if !waits {
            self.enter(system);
        }
        waits
    }

    fn enter(&mut self, system: &mut dyn System) {
        if let Some(mode) = self.pending.take() {
            let dags = self.modes[mode.index()].iter();
            dags.for_each(|&dag| system.resume(dag));
            system.entered(mode);
        }
    }

    /// Pauses what is off in the first mode, and enters that.
    pub(super) fn begin(&mut self, system: &mut dyn System) -> bool {
        self.pending
            .is_some_and(|first| self.ask(first, Entry::AtOnce, system))
    }

    /// Enters no further mode.
    pub(super) fn end(&mut self) {
        *self = Self::default();
    }

    pub(super) fn leave_alone(&mut self, dag: DagId) {
        let dags = self.modes.iter_mut().chain([&mut self.dags]);
        dags.for_each(|dags| dags.retain(|&other| other != dag));
    }
}

/// Returns the DAGs that are in some mode and not in this one.
fn leaving<'a>(dags: &'a [DagId], mode: &'a [DagId]) -> impl Iterator<Item = DagId> + 'a {
    dags.iter().copied().filter(|dag| !mode.contains(dag))
}
