//! Closing a DAG: its last jobs come to their end.
//!
//! This is how a machine is stopped in order: nothing more begins, and what has begun is
//! finished. The rules, whose scenarios in `tests/scenarios/lifecycle.txt` bear their numbers:
//!
//! - **C1, no release.** A closed DAG releases no job any more, at the very instant of the
//!   closing neither, since closings come before releases. No further job is due, so none is
//!   skipped either; a signal that is kept for one is forgotten.
//! - **C2, no backlog.** Releases that wait for an older job are skipped at the closing, the
//!   oldest first.
//! - **C3, in flight.** What was released goes on as ever, to its end, and may be late.
//! - **C4, over.** The DAG is over when nothing of it is in flight. Signals to it are dropped,
//!   and counted.
//! - **C5, finality.** It is neither paused nor resumed any more. A fault, or a stop, ends it
//!   as any other (E1 to E8).
//!
//! To the other rules a closing is nothing new: it is a limit of jobs that is there already.

use super::{DagPhase, Scheduler};
use crate::ids::DagId;
use crate::journal::What;

impl Scheduler {
    /// Closes a DAG (C1, C2).
    #[inline]
    pub(super) fn close(&mut self, dag: DagId) {
        if self.is_closed(dag) {
            return;
        }
        self.judge(dag, None);
        self.dags[dag.index()].jobs.close(DagPhase::Closed);
        self.log.of_dag(What::Closed, dag);
        while self.waiting(dag) > 0 {
            self.skip_oldest_waiting(dag);
        }
        self.set_timer(dag);
    }
}
