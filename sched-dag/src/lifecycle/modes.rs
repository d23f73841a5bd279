//! Modes: sets of DAGs, run one set at a time.
//!
//! A *mode* is a set of DAGs that run together, such as the DAGs of a flight, or of a landing. A
//! DAG of some mode is *on* in its modes and off, meaning paused, in the others. A DAG without a
//! mode runs in all. The scenarios of the rules, in `tests/scenarios/modes.txt`, bear their numbers
//! (M7 has its test in `tests/it/modes.rs`):
//!
//! - **M1, what is on.** A run with modes begins in mode 0. When a mode is entered, its DAGs are
//!   resumed, and all DAGs only in other modes are paused (P1 to P5). DAGs that are on in both the
//!   old and the new mode notice nothing.
//! - **M2, at once.** The mode is entered at the instant of the request. Jobs in flight of leaving
//!   DAGs go on to their ends, next to the jobs of joining DAGs.
//! - **M3, when idle.** The leaving DAGs are paused at the request. The mode is entered at the
//!   first instant at which none of their jobs is in flight: after the completions of that instant,
//!   before its releases, or at the request itself if no such job is in flight then. Until then the
//!   joining DAGs stay paused.
//! - **M4, the last one counts.** A new request replaces a request still waiting for its mode to be
//!   entered, whichever entry either asks for. A request for the present mode is allowed, too.
//! - **M5, what a person does.** A DAG that was paused or resumed at the console stays so until a
//!   mode is entered, or until a request pauses the DAG (M3).
//! - **M6, those that are gone.** An ended DAG stays ended; only its jobs in flight keep a
//!   mode waiting. After a shutdown no mode is entered.
//! - **M7, replays.** A DAG with recorded inputs is neither paused nor resumed, and no mode waits
//!   for the DAG (L6).
//!
//! A change of mode costs a pause or a resumption of each DAG of some mode, in a single step of the
//! scheduler. While a change waits, each step of the modes' cluster looks at the leaving DAGs.

use alloc::vec::Vec;

use super::LifecycleChange;
use crate::ids::{DagId, ModeId};
use crate::order::sorted;
use crate::request::ModeEntry;

/// The modes of a run.
#[derive(Clone, Debug, Default)]
pub(super) struct ModeTable {
    modes: Vec<ModeMembers>,
    /// The mode requested last. While the mode waits to be entered, it may be asked to go on.
    last: ModeId,
}

#[derive(Clone, Debug)]
struct ModeMembers {
    /// The DAGs in the mode.
    joining: Vec<DagId>,
    /// The DAGs that are only in other modes.
    leaving: Vec<DagId>,
}

impl ModeTable {
    pub(super) fn new(modes: Vec<Vec<DagId>>) -> Self {
        let mut all = sorted(&modes.concat());
        all.dedup();
        let of_dags = |joining: Vec<DagId>| ModeMembers {
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

    /// Returns the DAGs of all modes.
    pub(super) fn dags(&self) -> impl Iterator<Item = DagId> {
        // Each DAG of a mode is in the first one, or leaves when that is entered.
        let first = self.modes.first().into_iter();
        first.flat_map(|mode| mode.joining.iter().chain(&mode.leaving).copied())
    }

    /// Takes the request for a mode.
    pub(super) fn ask(
        &mut self,
        mode: ModeId,
        entry: ModeEntry,
        changes: &mut Vec<LifecycleChange>,
    ) {
        if let Some(asked) = self.modes.get(mode.index()) {
            let leaving = || asked.leaving.iter().copied();
            changes.extend(leaving().map(LifecycleChange::Pause));
            // Between pausing and resuming: the mode is entered when the leaving DAGs have ended
            // their jobs.
            if entry == ModeEntry::WhenIdle {
                changes.extend(leaving().map(LifecycleChange::Await));
            }
            changes.extend(asked.joining.iter().copied().map(LifecycleChange::Resume));
            // Last, so that a journal shows the mode after everything that led to it.
            changes.push(LifecycleChange::Enter(mode));
            self.last = mode;
        }
    }

    /// Asks once more for the waiting mode. Until the mode is entered, paused DAGs are left to a
    /// person.
    pub(super) fn go_on(&mut self, changes: &mut Vec<LifecycleChange>) {
        if let Some(asked) = self.modes.get(self.last.index()) {
            changes.extend(asked.leaving.iter().copied().map(LifecycleChange::Await));
            self.ask(self.last, ModeEntry::AtOnce, changes);
        }
    }

    pub(super) fn leave_alone(&mut self, dag: DagId) {
        for mode in &mut self.modes {
            mode.joining.retain(|&other| other != dag);
            mode.leaving.retain(|&other| other != dag);
        }
    }
}
