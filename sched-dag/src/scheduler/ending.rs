//! Ending a DAG before its time: by a fault of one of its instances, or a stop.
//!
//! Words: an instance *fails* when a fault has ended it: its function will never
//! return. A DAG is *ended* by the first instance of it that fails, unless
//! that costs the job only (the module `dropping`), or by a *stop*, which needs no fault; it
//! stays ended. It is *over* when nothing of it
//! is in flight or to come. The rules, whose scenarios in `tests/scenarios/ending.txt` bear
//! their numbers:
//!
//! - **E1, failure.** A failing instance has started. It ends at that instant:
//!   its core is free for the dispatch of the same instant. It may have been
//!   preempted in the scheduler's eyes, as when it finishes.
//! - **E2, no release.** An ended DAG releases no job, at the very instant of
//!   its end neither, since ends come before releases. Releases that wait are
//!   dropped; they are counted and not reported one by one.
//! - **E3, no start.** No instance of an ended DAG starts. Those that are ready
//!   are cancelled at once, the others when they would become ready: each once,
//!   and after all its predecessors have ended.
//! - **E4, what has started.** Its other started instances go on, preempted ones
//!   at their key, until they complete or fail, too. In an ended DAG nothing
//!   depends on them any more, so a driver that can take an instance's context
//!   away for good may complete it at once.
//! - **E5, jobs.** Each job in flight ends when no instance of it is left, with
//!   [`JobOutcome::DagEnded`](crate::JobOutcome::DagEnded), or as aborted if it
//!   was that before.
//! - **E6, deadlines.** A deadline that has passed before the instant of the end
//!   is a miss. No later deadline of the DAG is, and the run of consecutive
//!   misses stays as it is.
//! - **E7, others.** Nothing changes for other DAGs, except that cores are free
//!   for them: their releases, keys, joins and deadlines do not know of it. From
//!   that instant on the schedule is that of a set in which the ended DAG has no
//!   work left but its started instances.
//! - **E8, finality.** The scheduler never begins an ended DAG again: a subtask
//!   that failed may have left anything behind. A new scheduler may.
//!
//! Not here: whether a fault did harm beyond its instance, and what becomes of
//! its stack and values. That is the driver's.

use super::Scheduler;
use crate::ids::{DagId, Instance};
use crate::journal::What;

impl Scheduler {
    /// Ends an instance that has started, and its DAG (E1).
    #[inline]
    pub(super) fn fail(&mut self, instance: Instance) {
        let vertex = self.take_off(instance, "fails");
        let dag = instance.dag;
        self.dags[dag.index()].statistics.faults += 1;
        self.stop(dag);
        // Only now its job may end, so that the job counts as cut short.
        self.end(vertex);
    }

    /// Ends a DAG.
    #[inline]
    pub(super) fn stop(&mut self, dag: DagId) {
        if self.is_ended(dag) {
            return;
        }
        self.judge(dag, None);
        let state = &mut self.dags[dag.index()];
        let (cut_short, dropped) = state.jobs.end_all();
        state.statistics.cut_short += cut_short;
        state.statistics.dropped += dropped;
        self.set_timer(dag);
        self.log.of_dag(What::Stopped, dag);
        self.cancel_ready(dag, u64::MAX);
    }
}
