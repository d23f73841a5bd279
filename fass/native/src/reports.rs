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

use sched_dag::journal::What;
use sched_dag::{Notice, Scheduler};

use crate::execute::Execute;

/// Has bodies discard what cancelled instances got.
pub(crate) struct Reports<B> {
    pub(crate) bodies: B,
    /// Room for notices.
    notices: Vec<Notice>,
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

impl<B: Bodies> Reports<B> {
    pub(crate) fn new(scheduler: &mut Scheduler, bodies: B) -> Self {
        let room = scheduler.hear([What::Cancelled]);
        Self {
            bodies,
            notices: Vec::with_capacity(room),
        }
    }

    /// Has bodies discard what cancelled instances got.
    #[inline]
    pub(crate) fn act(&mut self, scheduler: &mut Scheduler) {
        if scheduler.log.has_notices() {
            self.discard(scheduler);
        }
    }

    // Apart, so that the way of instances that run stays as short as without it.
    #[cold]
    #[inline(never)]
    fn discard(&mut self, scheduler: &mut Scheduler) {
        scheduler.log.exchange_notices(&mut self.notices);
        for instance in self
            .notices
            .iter()
            .filter_map(|notice| notice.event.instance())
        {
            let vertex = scheduler.vertex(instance);
            self.bodies.discard(vertex.index(), instance.job);
        }
    }
}
