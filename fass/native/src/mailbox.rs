//! Where a worker is told what to run next by another one.
//!
//! Each worker has one mailbox, in cache lines of its own, and polls it while it has
//! nothing to do. At most one assignment is in it: the scheduler gives a core another
//! instance only after that core has reported the one before.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use sched_dag::Vertex;

/// An instance to be run, and what runs it.
#[derive(Debug)]
pub(crate) struct Assignment<B> {
    pub(crate) vertex: Vertex,
    pub(crate) job: u64,
    pub(crate) body: Box<B>,
}

/// The mailbox of one worker.
///
/// Aligned to two cache lines, since processors fetch them in pairs.
#[derive(Debug)]
#[repr(align(128))]
pub(crate) struct Mailbox<B> {
    is_full: AtomicBool,
    /// Taken without waiting, for whoever looks here has seen `is_full`.
    assignment: Mutex<Option<Assignment<B>>>,
}

impl<B> Mailbox<B> {
    pub(crate) const fn new() -> Self {
        Self {
            is_full: AtomicBool::new(false),
            assignment: Mutex::new(None),
        }
    }

    /// Leaves an assignment.
    pub(crate) fn put(&self, assignment: Assignment<B>) {
        let mut place = self
            .assignment
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        debug_assert!(place.is_none(), "a core has one assignment at a time");
        *place = Some(assignment);
        drop(place);
        // Pairs with the Acquire in `take`; the lock alone would do for the content.
        self.is_full.store(true, Ordering::Release);
    }

    /// Takes the assignment, if there is one.
    #[inline]
    pub(crate) fn take(&self) -> Option<Assignment<B>> {
        if !self.is_full.load(Ordering::Acquire) {
            return None;
        }
        self.is_full.store(false, Ordering::Relaxed);
        let place = self.assignment.lock();
        place.unwrap_or_else(PoisonError::into_inner).take()
    }
}
