//! Pausing a DAG: no releases for a while, on the same grid afterwards.
//!
//! A person, or a mode of the system, wants a DAG to rest and to go on later. The
//! rules, whose scenarios in `tests/scenarios/lifecycle.txt` bear their numbers:
//!
//! - **P1, no release.** A paused DAG releases no job. Each job that becomes due
//!   is skipped at that instant, whatever the overrun policy; at the instant of
//!   the pause, too, since pauses come before releases. Numbers and the grid O +
//!   kT go on. Of a sporadic DAG, the job that a signal asks for is skipped.
//! - **P2, no backlog.** Releases that wait for an older job are skipped at the
//!   pause, the oldest first. Each costs a step, once.
//! - **P3, in flight.** What was released goes on as ever, to its end.
//! - **P4, resuming.** The first job that is due at the instant of the resumption
//!   or later is released at its nominal release time.
//! - **P5, the end.** Skipped jobs count towards the limit of jobs, so a paused
//!   DAG with a limit comes to its end. A closed or ended DAG is neither paused nor
//!   resumed.
//!
//! To the other rules a pause is nothing new: a job is skipped as with
//! [`OverrunPolicy::Skip`](crate::OverrunPolicy::Skip).

use super::{DagPhase, Scheduler};
use crate::ids::DagId;
use crate::journal::What;

impl Scheduler {
    /// Reports whether a DAG is paused.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[must_use]
    #[inline]
    pub fn is_paused(&self, dag: DagId) -> bool {
        self.phase(dag) == DagPhase::Paused
    }

    /// Returns the number of jobs of a DAG that are in flight.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[must_use]
    #[inline]
    pub fn in_flight(&self, dag: DagId) -> u64 {
        let jobs = &self.dags[dag.index()].jobs;
        jobs.next - jobs.oldest
    }

    /// Pauses a DAG (P1, P2).
    #[inline]
    pub(super) fn pause(&mut self, dag: DagId) {
        if self.is_closed(dag) {
            return;
        }
        // What was late before the pause is a miss.
        self.judge(dag, None);
        let phase = &mut self.dags[dag.index()].jobs.phase;
        if core::mem::replace(phase, DagPhase::Paused) != DagPhase::Paused {
            self.log.of_dag(What::Off, dag);
        }
        while self.waiting(dag) > 0 {
            self.skip_oldest_waiting(dag);
        }
        self.set_timer(dag);
    }

    /// Ends the pause of a DAG (P4).
    #[inline]
    pub(super) fn resume(&mut self, dag: DagId) {
        let state = &mut self.dags[dag.index()];
        if state.jobs.phase == DagPhase::Paused {
            state.jobs.phase = DagPhase::Running;
            state.resumed_ns = self.log.now_ns;
            self.log.of_dag(What::On, dag);
        }
    }
}
