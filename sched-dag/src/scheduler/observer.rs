//! What the scheduler reports besides its decisions.
//!
//! Every report happens at the instant that the driver has given to
//! [`Scheduler::at`](crate::Scheduler::at), so none carries a "now".

use crate::ids::{DagId, Instance, ModeId};
use crate::policy::JobOutcome;

/// A receiver of the scheduler's reports; every method does nothing by default.
///
/// `()` ignores all reports.
pub trait Observer {
    /// Job `job` is released; `release_ns` is its nominal release time, which
    /// is earlier than now if the release had to wait.
    fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        let _ = (dag, job, release_ns);
    }

    /// The release of job `job` is due and waits for an older job to end.
    fn queued(&mut self, dag: DagId, job: u64, release_ns: u64) {
        let _ = (dag, job, release_ns);
    }

    /// The release of job `job` does not happen.
    fn skipped(&mut self, dag: DagId, job: u64, release_ns: u64) {
        let _ = (dag, job, release_ns);
    }

    /// A sporadic DAG got a signal, which lets job `job` be due at `release_ns`,
    /// now or later; `None`: the signal is dropped, and `job` is the one that an
    /// earlier signal is kept for, or that will not be.
    fn signalled(&mut self, dag: DagId, job: u64, release_ns: Option<u64>) {
        let _ = (dag, job, release_ns);
    }

    /// All that the instance waits for has happened (R2).
    fn ready(&mut self, instance: Instance) {
        let _ = instance;
    }

    /// The instance will not run, because its job is cut or its DAG is
    /// ended; what its predecessors have sent to it can be dropped.
    fn cancelled(&mut self, instance: Instance) {
        let _ = instance;
    }

    /// Job `job` starts no further instance, to make room for a newer job.
    fn aborted(&mut self, dag: DagId, job: u64) {
        let _ = (dag, job);
    }

    /// The instance has failed, and its DAG goes on (D1): its job is cut, and its
    /// subtask's next instances are another function's. Reported before all that
    /// follows from it.
    fn restarted(&mut self, instance: Instance) {
        let _ = instance;
    }

    /// The DAG is ended, by a fault or a stop: it starts no further instance.
    /// Reported once, before all that follows from it.
    fn ended(&mut self, dag: DagId) {
        let _ = dag;
    }

    /// The DAG is paused: it releases no job from now on.
    fn switched_off(&mut self, dag: DagId) {
        let _ = dag;
    }

    /// The DAG is resumed: what is due from now on is released.
    fn switched_on(&mut self, dag: DagId) {
        let _ = dag;
    }

    /// The DAG is closed: it releases no further job.
    fn closed(&mut self, dag: DagId) {
        let _ = dag;
    }

    /// The run is in another mode. Reported by the driver, as the scheduler knows none.
    fn entered(&mut self, mode: ModeId) {
        let _ = mode;
    }

    /// The deadline of job `job` has passed, and the job is not complete.
    fn deadline_missed(&mut self, dag: DagId, job: u64, deadline_ns: u64) {
        let _ = (dag, job, deadline_ns);
    }

    /// No instance of job `job` is left (R4).
    fn job_completed(&mut self, dag: DagId, job: u64, outcome: JobOutcome) {
        let _ = (dag, job, outcome);
    }
}

impl Observer for () {}

/// Passes every report on: to what is behind a reference, to both of a pair.
macro_rules! pass_on {
    ($($report:ident($($name:ident: $type:ty),+);)+) => {
        impl<O: Observer + ?Sized> Observer for &mut O {
            $(#[inline]
            fn $report(&mut self, $($name: $type),+) {
                (**self).$report($($name),+);
            })+
        }

        impl<A: Observer, B: Observer> Observer for (A, B) {
            $(#[inline]
            fn $report(&mut self, $($name: $type),+) {
                self.0.$report($($name),+);
                self.1.$report($($name),+);
            })+
        }
    };
}

pass_on! {
    released(dag: DagId, job: u64, release_ns: u64);
    queued(dag: DagId, job: u64, release_ns: u64);
    skipped(dag: DagId, job: u64, release_ns: u64);
    signalled(dag: DagId, job: u64, release_ns: Option<u64>);
    ready(instance: Instance);
    cancelled(instance: Instance);
    aborted(dag: DagId, job: u64);
    restarted(instance: Instance);
    ended(dag: DagId);
    switched_off(dag: DagId);
    switched_on(dag: DagId);
    closed(dag: DagId);
    entered(mode: ModeId);
    deadline_missed(dag: DagId, job: u64, deadline_ns: u64);
    job_completed(dag: DagId, job: u64, outcome: JobOutcome);
}
