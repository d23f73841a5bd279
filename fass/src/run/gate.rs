//! The gate that the platform opens for a subtask's future, once for each job.
//!
//! A subtask's future waits in one place only: at the gate in front of
//! `recv_all`. The *grant* that opens it names a job, and the platform gives
//! it when the scheduler says that the instance runs; values arriving on topics
//! do not. This is what keeps a body from circumventing the task model: an
//! instance cannot begin before all its predecessors are complete (R2), because
//! beginning is not in the future's own hands, and the future has no second
//! place to wait at, so it reaches the end of its instance in the same poll
//! (R3).
//!
//! The gate's words are atomics only because a future must be `Send`. All
//! accesses are `Relaxed`, plain loads and stores on every processor: the gate
//! belongs to one [`Body`](crate::Body), whose `&mut self` already orders one
//! use after another, on whatever cores.

use alloc::sync::Arc;
use core::sync::atomic::{AtomicU8, AtomicU64, Ordering};

/// A shared handle of one subtask's gate.
#[derive(Clone)]
pub(crate) struct Gate(Arc<State>);

struct State {
    phase: AtomicU8,
    job: AtomicU64,
}

/// Waiting for a grant.
const CLOSED: u8 = 0;
/// A job is granted and not yet begun.
const OPEN: u8 = 1;
/// The future passed the gate and has not reported the end.
const PASSED: u8 = 2;

impl Gate {
    pub(crate) fn new() -> Self {
        Self(Arc::new(State {
            phase: AtomicU8::new(CLOSED),
            job: AtomicU64::new(0),
        }))
    }

    /// Opens the gate for the subtask's part of one job.
    pub(crate) fn open(&self, job: u64) {
        self.0.job.store(job, Ordering::Relaxed);
        self.0.phase.store(OPEN, Ordering::Relaxed);
    }

    /// Passes the gate if it is open, and returns the job. If it is not, the
    /// next poll comes after it was opened, so no waker needs to be kept.
    #[inline]
    pub(crate) fn pass(&self) -> Option<u64> {
        if self.0.phase.load(Ordering::Relaxed) != OPEN {
            return None;
        }
        self.0.phase.store(PASSED, Ordering::Relaxed);
        Some(self.job())
    }

    /// Closes the gate behind a grant that has been carried out.
    pub(crate) fn close(&self) {
        self.0.phase.store(CLOSED, Ordering::Relaxed);
    }

    /// Reports whether the last grant, if any, has been carried out to its end.
    pub(crate) fn is_closed(&self) -> bool {
        self.0.phase.load(Ordering::Relaxed) == CLOSED
    }

    /// Returns the job of the last grant.
    pub(crate) fn job(&self) -> u64 {
        self.0.job.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::Gate;

    #[test]
    fn a_closed_gate_lets_nobody_pass() {
        let gate = Gate::new();
        assert_eq!(gate.pass(), None);
        assert_eq!(gate.pass(), None);
    }

    #[test]
    fn one_grant_passes_once() {
        let gate = Gate::new();
        gate.open(7);
        assert!(!gate.is_closed());
        assert_eq!(gate.pass(), Some(7));
        assert_eq!(gate.pass(), None);
        assert!(!gate.is_closed(), "open until the end is reported");
        gate.close();
        assert!(gate.is_closed());
    }
}
