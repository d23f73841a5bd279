//! What a worker and the owner of the scheduler's lock tell each other.
//!
//! A worker *posts* that it has finished an instance; the lock's owner *assigns* it the
//! next one. Both are one word, in cache lines of their own, with a single writer: the
//! worker, and the lock's owner. Each message is one store and
//! costs one transfer. Nobody clears a message: each has a *turn* in it, a number that
//! differs from the turn before, so one is told from the next.
//!
//! That a post was taken note of is known under the lock. The worker is told, too, but
//! as a *hint*, which may come late or be lost: without it the worker looks under the
//! lock.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use sched_dag::{DagId, Vertex};

/// The bit of a post that says that there are signals to be taken out, too.
const SIGNALS: u64 = 1 << 32;
/// Where the turn begins.
const TURN: u32 = 33;

/// An instance to be run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Assignment {
    pub(crate) vertex: Vertex,
    pub(crate) job: u64,
}

/// The end of an instance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct End {
    pub(crate) vertex: Vertex,
    /// Whether it has left signals to be taken out.
    pub(crate) has_signals: bool,
}

/// That a worker has finished an instance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Post {
    pub(crate) end: End,
    pub(crate) turn: u32,
}

/// The mailbox of one worker: what it writes, and what it reads.
#[derive(Debug)]
pub(crate) struct Mailbox {
    outgoing: Outgoing,
    incoming: Incoming,
}

/// Aligned to two cache lines, since processors fetch them in pairs.
#[derive(Debug)]
#[repr(align(128))]
struct Outgoing {
    post: AtomicU64,
    signals: Mutex<Vec<DagId>>,
}

#[derive(Debug)]
#[repr(align(128))]
struct Incoming {
    assignment: AtomicU64,
    job: AtomicU64,
    /// The turn of the latest post that was taken note of.
    hint: AtomicU32,
}

impl Mailbox {
    /// Makes one with room for `signals` signals. Turn 0 is taken as already seen, in both
    /// directions.
    pub(crate) fn new(signals: usize) -> Self {
        Self {
            outgoing: Outgoing {
                post: AtomicU64::new(0),
                signals: Mutex::new(Vec::with_capacity(signals)),
            },
            incoming: Incoming {
                assignment: AtomicU64::new(0),
                job: AtomicU64::new(0),
                hint: AtomicU32::new(0),
            },
        }
    }

    /// Posts the worker's completion, and returns the turn.
    #[inline]
    pub(crate) fn post(&self, vertex: Vertex, has_signals: bool) -> u32 {
        let place = &self.outgoing.post;
        let turn = next_turn(place.load(Ordering::Relaxed));
        let signals = if has_signals { SIGNALS } else { 0 };
        let word = u64::from(turn) << TURN | signals | u64::from(vertex.0);
        // Release: a reader of it may pass on to successors what the body has done.
        place.store(word, Ordering::Release);
        turn
    }

    /// Returns the latest post.
    #[inline]
    pub(crate) fn posted(&self) -> Post {
        let word = self.outgoing.post.load(Ordering::Acquire);
        Post {
            end: End {
                vertex: Vertex(low(word)),
                has_signals: word & SIGNALS != 0,
            },
            turn: low(word >> TURN),
        }
    }

    /// Assigns an instance to the worker; by the lock's owner.
    #[inline]
    pub(crate) fn assign(&self, assignment: Assignment) {
        let place = &self.incoming.assignment;
        let turn = next_turn(place.load(Ordering::Relaxed));
        self.incoming.job.store(assignment.job, Ordering::Relaxed);
        let word = u64::from(turn) << TURN | u64::from(assignment.vertex.0);
        // Release: for the job, and for what its predecessors have done.
        place.store(word, Ordering::Release);
    }

    /// Returns the latest assignment if it is a later one than `seen`, and notes its
    /// turn there.
    #[inline]
    pub(crate) fn assigned_after(&self, seen: &mut u32) -> Option<Assignment> {
        let word = self.incoming.assignment.load(Ordering::Acquire);
        let turn = low(word >> TURN);
        if turn == *seen {
            return None;
        }
        *seen = turn;
        Some(Assignment {
            vertex: Vertex(low(word)),
            job: self.incoming.job.load(Ordering::Relaxed),
        })
    }

    /// Hints that the post of a turn was taken note of.
    #[inline]
    pub(crate) fn hint(&self, turn: u32) {
        self.incoming.hint.store(turn, Ordering::Relaxed);
    }

    #[inline]
    pub(crate) fn is_hinted(&self, turn: u32) -> bool {
        self.incoming.hint.load(Ordering::Relaxed) == turn
    }

    /// Returns the signals that belong to the post.
    pub(crate) fn signals(&self) -> MutexGuard<'_, Vec<DagId>> {
        let signals = self.outgoing.signals.lock();
        signals.unwrap_or_else(PoisonError::into_inner)
    }
}

/// Returns the turn after that of a word.
const fn next_turn(word: u64) -> u32 {
    // 31 bits are left for it; nobody falls behind by that many.
    low(word >> TURN).wrapping_add(1) & (u32::MAX >> 1)
}

/// Returns the low 32 bits.
#[allow(clippy::cast_possible_truncation, reason = "that is its purpose")]
const fn low(word: u64) -> u32 {
    word as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_tell_messages_apart_and_wrap() {
        let mailbox = Mailbox::new(0);
        let mut seen = 0;
        assert!(mailbox.assigned_after(&mut seen).is_none());
        for job in [7, 8] {
            let vertex = Vertex(u32::MAX);
            mailbox.assign(Assignment { vertex, job });
            let assignment = mailbox.assigned_after(&mut seen).expect("a new one");
            assert_eq!((assignment.vertex, assignment.job), (vertex, job));
            assert!(mailbox.assigned_after(&mut seen).is_none());
        }
        let turn = mailbox.post(Vertex(3), true);
        let post = mailbox.posted();
        assert_eq!(
            (post.end.vertex, post.end.has_signals, post.turn),
            (Vertex(3), true, turn)
        );
        assert!(!mailbox.is_hinted(turn));
        mailbox.hint(turn);
        assert!(mailbox.is_hinted(turn));
        assert_eq!(next_turn(u64::MAX), 0);
        assert_eq!(next_turn(u64::MAX >> 1), 1 << 30);
    }
}
