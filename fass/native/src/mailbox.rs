//! What a worker and whoever has the scheduler tell each other.
//!
//! Each worker has one mailbox, in cache lines of its own, with one *word* in it:
//!
//! - `POSTED`, by the worker: it has finished an instance of this vertex. It is the
//!   task of whoever has the scheduler to take note of that, and to clear the word.
//! - `ASSIGNED`, by whoever has the scheduler: the worker shall run this vertex, in the
//!   job beside the word. The worker clears it.
//! - `EMPTY`: neither.
//!
//! A word has one writer at a time. A worker posts only while it has an instance; it is
//! assigned one only when it has none and nothing posted. So each message is one store,
//! and costs one transfer of a cache line.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use sched_dag::{DagId, Vertex};

const EMPTY: u64 = 0;
const POSTED: u64 = 1 << 32;
const ASSIGNED: u64 = 2 << 32;
/// With `POSTED`: signals are to be taken out, too.
const SIGNALS: u64 = 4 << 32;

/// An instance to be run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Assignment {
    pub(crate) vertex: Vertex,
    pub(crate) job: u64,
}

/// What a mailbox says.
pub(crate) enum Mail {
    Nothing,
    /// The worker has finished an instance, perhaps with signals.
    Posted(Vertex, bool),
    Assigned(Assignment),
}

/// The mailbox of one worker.
///
/// Aligned to two cache lines, since processors fetch them in pairs.
#[derive(Debug)]
#[repr(align(128))]
pub(crate) struct Mailbox {
    word: AtomicU64,
    job: AtomicU64,
    signals: Mutex<Vec<DagId>>,
}

impl Mailbox {
    /// Makes one with room for so many signals.
    pub(crate) fn new(signals: usize) -> Self {
        Self {
            word: AtomicU64::new(EMPTY),
            job: AtomicU64::new(0),
            signals: Mutex::new(Vec::with_capacity(signals)),
        }
    }

    /// Posts the worker's completion.
    #[inline]
    pub(crate) fn post(&self, vertex: Vertex, has_signals: bool) {
        let signals = if has_signals { SIGNALS } else { 0 };
        let word = POSTED | signals | u64::from(vertex.0);
        // Release: whoever reads it may let successors see what the body has done.
        self.word.store(word, Ordering::Release);
    }

    /// Assigns an instance to the worker.
    #[inline]
    pub(crate) fn assign(&self, assignment: Assignment) {
        self.job.store(assignment.job, Ordering::Relaxed);
        let word = ASSIGNED | u64::from(assignment.vertex.0);
        // Release: for the job, and for what its predecessors have done.
        self.word.store(word, Ordering::Release);
    }

    #[inline]
    pub(crate) fn read(&self) -> Mail {
        let word = self.word.load(Ordering::Acquire);
        if word == EMPTY {
            return Mail::Nothing;
        }
        let vertex = Vertex(low(word));
        if word & POSTED != 0 {
            return Mail::Posted(vertex, word & SIGNALS != 0);
        }
        let job = self.job.load(Ordering::Relaxed);
        Mail::Assigned(Assignment { vertex, job })
    }

    /// Clears it, by whoever the message was for.
    #[inline]
    pub(crate) fn clear(&self) {
        // Release: a worker that sees its post gone may go home.
        self.word.store(EMPTY, Ordering::Release);
    }

    /// Returns the signals that belong to the post.
    pub(crate) fn signals(&self) -> MutexGuard<'_, Vec<DagId>> {
        self.signals.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Returns the low 32 bits.
#[allow(clippy::cast_possible_truncation, reason = "that is its purpose")]
const fn low(word: u64) -> u32 {
    word as u32
}
