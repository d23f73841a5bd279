//! Modes: sets of DAGs, one of which runs.
//!
//! A *mode* is a set of DAGs that run together, such as those of a flight, or of a landing. A
//! DAG that is in some mode is *on* in its modes and off, that is paused, in the others; a
//! DAG that is in none runs in all. The rules, whose scenarios in `tests/scenarios/modes.txt` bear
//! their numbers (M7 has its test in `tests/modes.rs`):
//!
//! - **M1, what is on.** A run begins in mode 0. When a mode is entered, its DAGs are resumed, and
//!   the others that are in some mode are paused (P1 to P5). DAGs that are on in the old
//!   mode and in the new one notice nothing.
//! - **M2, at once.** The mode is entered at the instant of the request. What is in flight of the
//!   DAGs that leave goes on to its end, next to the jobs of those that join.
//! - **M3, when idle.** The DAGs that leave are paused at the request. The mode is entered at the
//!   first instant at which no job of them is in flight: after the completions of that
//!   instant, before its releases; at the request itself, if none is then. Until then the DAGs that
//!   join stay paused.
//! - **M4, the last one counts.** A request takes the place of one that has not come about, in
//!   whichever way it asks to be entered. The mode that is there may be asked for, too.
//! - **M5, what a person does.** A DAG that was paused or resumed at the console stays so until a
//!   mode is entered.
//! - **M6, those that are gone.** An ended DAG stays so; it keeps no mode waiting but by what is in
//!   flight. After a shutdown no mode is entered.
//! - **M7, replays.** A DAG whose inputs are recorded is neither paused nor resumed, and none waits
//!   for it (L6).
//!
//! A change costs a pause or a resumption of each DAG that is in some mode, in one step of the
//! scheduler; one that waits costs a look at the DAGs that leave in each step until then.

use alloc::vec::Vec;

use super::{Change, Entry};
use crate::ids::{DagId, ModeId};
use crate::order::sorted;

/// The modes of a run.
#[derive(Clone, Debug, Default)]
pub(super) struct Modes {
    modes: Vec<Mode>,
    /// The one that was asked for last. As long as it waits, it may be asked to go on.
    last: ModeId,
}

#[derive(Clone, Debug)]
struct Mode {
    /// The DAGs that are in it.
    joining: Vec<DagId>,
    /// Those that are only in others.
    leaving: Vec<DagId>,
}

impl Modes {
    pub(super) fn new(modes: Vec<Vec<DagId>>) -> Self {
        let mut all = sorted(&modes.concat());
        all.dedup();
        let of_dags = |joining: Vec<DagId>| Mode {
            leaving: (all.iter().copied())
                .filter(|dag| !joining.contains(dag))
                .collect(),
            joining,
        };
        Self {
            modes: modes.into_iter().map(of_dags).collect(),
            last: ModeId(0),
        }
    }

    pub(super) const fn count(&self) -> usize {
        self.modes.len()
    }

    /// Returns the DAGs that are in some mode.
    pub(super) fn dags(&self) -> impl Iterator<Item = DagId> {
        // Each is in the first one, or leaves when that is entered.
        let first = self.modes.first().into_iter();
        first.flat_map(|mode| mode.joining.iter().chain(&mode.leaving).copied())
    }

    /// Takes the request for a mode.
    pub(super) fn ask(&mut self, mode: ModeId, entry: Entry, changes: &mut Vec<Change>) {
        if let Some(asked) = self.modes.get(mode.index()) {
            let leaving = || asked.leaving.iter().copied();
            changes.extend(leaving().map(Change::Pause));
            if entry == Entry::WhenIdle {
                changes.extend(leaving().map(Change::Await));
            }
            changes.extend(asked.joining.iter().copied().map(Change::Resume));
            changes.push(Change::Enter(mode));
            self.last = mode;
        }
    }

    /// Asks once more for the mode that waits, and leaves paused DAGs to a person until it is there.
    pub(super) fn go_on(&mut self, changes: &mut Vec<Change>) {
        if let Some(asked) = self.modes.get(self.last.index()) {
            changes.extend(asked.leaving.iter().copied().map(Change::Await));
            self.ask(self.last, Entry::AtOnce, changes);
        }
    }

    pub(super) fn leave_alone(&mut self, dag: DagId) {
        for mode in &mut self.modes {
            mode.joining.retain(|&other| other != dag);
            mode.leaving.retain(|&other| other != dag);
        }
    }
}
