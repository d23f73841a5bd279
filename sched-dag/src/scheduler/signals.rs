//! Sporadic DAGs: released by signals, never faster than stated.
//!
//! Words: a *signal* is an event asking for one job of a sporadic DAG. The DAG's *minimum
//! inter-arrival time* T is its period in the model. The scenarios of the rules, in
//! `tests/scenarios/sharing.txt`, bear their numbers:
//!
//! - **S1, release.** A signal at time a makes the next job k due at its nominal release time
//!   r(k) = max(a, r(k-1) + T), job 0 at max(a, O). So a signal that comes early is delayed.
//!   Releases are never less than T apart, whatever sends the signals.
//! - **S2, one is kept.** While a signal's job is not yet due, or is due and waits for an older job
//!   to end, further signals are *dropped*, and counted. So a burst of signals costs at most two
//!   jobs, and constant memory.
//! - **S3, from there on as ever.** The deadline is r(k) + D; overrun policy, keys, joins and
//!   misses are as for a periodic job. A signal at the instant of a completion may release at that
//!   instant: signals come after completions and before releases.
//! - **S4, the end.** Signals beyond the limit of jobs, and to a closed or ended DAG, are dropped.
//!   A sporadic DAG without limit is over whenever nothing of it is in flight and no signal is
//!   kept: it keeps no run going.
//!
//! For the analysis a sporadic DAG is a DAG with period T. The tests that answer for sporadic DAGs
//! hold for every pattern of releases at least T apart, as in the sporadic model of the papers
//! behind them. A response time counts from r(k), not from the signal, which may have come up to T
//! before.

use super::Scheduler;
use crate::ids::DagId;
use crate::journal::EventKind;

impl Scheduler {
    /// Takes a signal to a sporadic DAG.
    #[inline]
    pub(super) fn signal(&mut self, dag: DagId) {
        assert!(
            self.task_set.dag(dag).is_sporadic(),
            "a signal to dag {}, which is periodic; signal sporadic DAGs only",
            dag.0
        );
        // If the driver is late, a job due before this signal comes first, so that the job's own
        // signal is no longer kept.
        if self.dags[dag.index()].jobs.is_overdue(self.log.now_ns) {
            self.serve(dag);
        }
        let model = self.task_set.dag(dag);
        let state = &mut self.dags[dag.index()];
        // Read before the signal is taken, because taking it may make this job due.
        let job = state.jobs.signal_job();
        let release_ns = state.jobs.signal(model, self.log.now_ns);
        state.statistics.signals += 1;
        if release_ns.is_none() {
            state.statistics.dropped_signals += 1;
        }
        let what = match release_ns {
            Some(_) => EventKind::Signalled,
            None => EventKind::Dropped,
        };
        self.log.of_job(what, dag, job, release_ns);
        self.set_timer(dag);
    }
}
