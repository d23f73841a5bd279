//! What the scheduler reports during a run: to its observer, and to bodies.
//!
//! An instance that is *cancelled* never runs, but its predecessors may have run and
//! sent it values. Later jobs need their slots. So its body
//! [discards](Execute::discard) them at once, on the worker that steps the scheduler;
//! what is in a slot is dropped by the predecessor that next uses it.
//!
//! # The body is at rest
//!
//! A cancelled instance has not started. Its predecessors, and the instances of its
//! subtask in the jobs before, have ended in the scheduler's eyes; a worker gives a body
//! back before it posts that. So nobody has the body, and all that was sent has arrived.
//!
//! # Where it happens
//!
//! In runs that are recorded: jobs are aborted where the scheduler's clock goes on
//! while they run. Where it stands still, no job is left in flight when the next is
//! due, so nothing is ever cancelled.

use std::sync::{Arc, Mutex, PoisonError};

use sched_dag::{DagId, Instance, JobOutcome, Observer, TaskSet};

use crate::execute::Execute;

/// Passes all on to `watch`, and has bodies discard what cancelled instances got.
pub(crate) struct Reports<W, B> {
    pub(crate) watch: W,
    pub(crate) bodies: B,
    task_set: Arc<TaskSet>,
}

/// Bodies at rest can be found among them, by vertex.
pub(crate) trait Bodies {
    /// Has a body that is at rest drop what has arrived for a job.
    fn discard(&mut self, vertex: usize, job: u64);
}

/// A value in a cache line of its own.
#[repr(align(64))]
pub(crate) struct Line<T>(pub(crate) T);

/// All bodies, by vertex, where several workers run them. A worker that was
/// assigned a vertex locks its body; the one that steps the scheduler, a body at rest. So
/// nobody ever waits.
pub(crate) type Shared<B> = Arc<[Line<Mutex<B>>]>;

impl<B: Execute> Bodies for &mut [B] {
    fn discard(&mut self, vertex: usize, job: u64) {
        self[vertex].discard(job);
    }
}

impl<B: Execute> Bodies for Shared<B> {
    fn discard(&mut self, vertex: usize, job: u64) {
        let body = self[vertex].0.lock();
        body.unwrap_or_else(PoisonError::into_inner).discard(job);
    }
}

impl<W, B> Reports<W, B> {
    pub(crate) fn new(task_set: &Arc<TaskSet>, watch: W, bodies: B) -> Self {
        Self {
            watch,
            bodies,
            task_set: Arc::clone(task_set),
        }
    }
}

impl<W: Observer, B: Bodies> Observer for Reports<W, B> {
    // Apart, so that the way of instances that run stays as short as without it.
    #[cold]
    #[inline(never)]
    fn cancelled(&mut self, instance: Instance) {
        self.watch.cancelled(instance);
        let vertex = self.task_set.vertex(instance);
        self.bodies.discard(vertex.index(), instance.job);
    }

    #[inline]
    fn ready(&mut self, instance: Instance) {
        self.watch.ready(instance);
    }

    #[inline]
    fn released(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.watch.released(dag, job, release_ns);
    }

    #[inline]
    fn job_completed(&mut self, dag: DagId, job: u64, outcome: JobOutcome) {
        self.watch.job_completed(dag, job, outcome);
    }

    fn queued(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.watch.queued(dag, job, release_ns);
    }

    fn skipped(&mut self, dag: DagId, job: u64, release_ns: u64) {
        self.watch.skipped(dag, job, release_ns);
    }

    fn signalled(&mut self, dag: DagId, job: u64, release_ns: Option<u64>) {
        self.watch.signalled(dag, job, release_ns);
    }

    fn aborted(&mut self, dag: DagId, job: u64) {
        self.watch.aborted(dag, job);
    }

    fn ended(&mut self, dag: DagId) {
        self.watch.ended(dag);
    }

    fn deadline_missed(&mut self, dag: DagId, job: u64, deadline_ns: u64) {
        self.watch.deadline_missed(dag, job, deadline_ns);
    }
}
