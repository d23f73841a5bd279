//! Faults that cost a job: the DAG goes on with the next one.
//!
//! A robot cannot do without its DAG because one frame was broken. So a DAG may say that it
//! *survives* faults ([`OnFault::DropJob`]): the job is *cut*, which is to say that it starts
//! no further instance, and the subtask that failed goes on with another function, which
//! the driver has. The rules, whose scenarios in `tests/scenarios/faults.txt` bear their numbers:
//!
//! - **D1, which faults.** A fault in job k is survived if the DAG says so and is not ended,
//!   the driver has another function for the subtask, fewer than A faults were survived
//!   before, and the N-th survived one before this was in job k - W or earlier, or there was
//!   none. (N faults in a window of W jobs, A in all.) Any other fault ends the DAG (E1 to
//!   E8).
//! - **D2, the instance.** It ends as E1 says. The subtask's next instance may start at that
//!   instant.
//! - **D3, its job.** Unless it is cut already, the job is cut: instances that are ready are
//!   cancelled at once, the others when they would become ready; those that have started go
//!   on, at their key, to their end. The job ends when no instance of it is left, with
//!   [`JobOutcome::Failed`].
//! - **D4, other jobs.** Nothing changes for them: those in flight go on, and the next ones
//!   are released as ever, on the same grid.
//! - **D5, deadlines.** A deadline that has passed before the instant of the fault is a miss.
//!   No later one of the job is, and the run of consecutive misses stays as it is.
//! - **D6, one instant.** Several faults of one instant count in the order in which the
//!   driver tells them; the first one that is not survived ends the DAG.
//! - **D7, others.** Nothing changes for other DAGs, except that cores are free for them.
//!
//! A job that was aborted before may have a fault, too, in what had started: that counts as
//! a fault, and the job stays aborted.

use alloc::boxed::Box;
use alloc::vec;

use super::Scheduler;
use crate::ids::{DagId, Instance};
use crate::journal::What;
use crate::policy::{JobOutcome, OnFault};

/// The latest survived faults of a DAG.
#[derive(Clone, Debug, Hash)]
pub(super) struct Survived {
    window: u64,
    /// How many there may still be.
    left: u32,
    /// The jobs of the latest ones, as many as there may be in a window.
    jobs: Box<[u64]>,
    /// The place of the oldest of these, once there are so many.
    oldest: usize,
    count: usize,
}

impl Survived {
    pub(super) fn new(on_fault: OnFault) -> Self {
        let (window, left, most) = match on_fault {
            OnFault::EndDag => (0, 0, 0),
            OnFault::DropJob(of) => (of.window, of.in_all, of.faults.min(of.in_all)),
        };
        Self {
            window,
            left,
            jobs: vec![0; most as usize].into_boxed_slice(),
            oldest: 0,
            count: 0,
        }
    }

    /// Reports whether a fault in a job would be survived (D1).
    fn would_take(&self, job: u64) -> bool {
        let has_room = self.count < self.jobs.len();
        let nth_before = self.jobs.get(self.oldest);
        let last_outside = job.checked_sub(self.window);
        let is_outside = |before| last_outside.is_some_and(|last| before <= last);
        self.left > 0 && (has_room || nth_before.is_some_and(|&before| is_outside(before)))
    }

    /// Counts a fault in a job, if it is survived, and reports whether it is.
    fn take(&mut self, job: u64) -> bool {
        let is_survived = self.would_take(job);
        if is_survived && let Some(place) = self.jobs.get_mut(self.oldest) {
            *place = job;
            self.oldest = (self.oldest + 1) % self.jobs.len();
            self.count = self.jobs.len().min(self.count + 1);
            self.left -= 1;
        }
        is_survived
    }
}

impl Scheduler {
    /// Reports whether a DAG would survive a fault in a job now, if the driver has another
    /// function for the subtask (D1).
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[must_use]
    pub fn survives(&self, dag: DagId, job: u64) -> bool {
        !self.is_ended(dag) && self.dags[dag.index()].survived.would_take(job)
    }

    /// Ends an instance that has started, and cuts its job or ends its DAG (D1).
    #[inline]
    pub(super) fn fail_replaceable(&mut self, instance: Instance) {
        let dag = instance.dag;
        if self.is_ended(dag) || !self.dags[dag.index()].survived.take(instance.job) {
            self.fail(instance);
            return;
        }
        let vertex = self.take_off(instance, "fails");
        self.judge(dag, None);
        let sequence = self.vertices.get(vertex).progress;
        let state = &mut self.dags[dag.index()];
        state.statistics.faults += 1;
        state.statistics.restarts += 1;
        self.log.of(What::Restarted, instance);
        if state.jobs.cut(sequence, JobOutcome::Failed) {
            state.statistics.failed += 1;
            self.cancel_ready(dag, sequence);
        }
        self.end(vertex);
        self.set_timer(dag);
    }
}
