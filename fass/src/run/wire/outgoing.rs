//! Bytes on their way out: what an instance sends goes when it is complete, whole or not at all.
//!
//! The function puts its bytes ahead in the ring; the completion shows them, which is one store
//! however many they are. If one of them found no room, all that the instance sent is lost.

use alloc::sync::Arc;
use core::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use sched_dag::lifecycle::Request;

use super::Counter;
use super::ring::Ring;
use crate::run::effect::Effect;

/// The way out of a wire.
pub(crate) struct Outgoing {
    ring: Ring,
    /// How many bytes the instance has sent that is not complete yet, and whether one of them
    /// found no room.
    staged: AtomicUsize,
    is_lost: AtomicBool,
    /// Bytes that were shown.
    pub(crate) sent: Counter,
    /// Bytes for which there was no room.
    pub(crate) lost: Counter,
}

impl Outgoing {
    pub(crate) fn new(room_bytes: usize) -> Self {
        Self {
            ring: Ring::new(room_bytes),
            staged: AtomicUsize::new(0),
            is_lost: AtomicBool::new(false),
            sent: Counter::default(),
            lost: Counter::default(),
        }
    }

    /// Forgets what an instance has sent that never was complete.
    pub(crate) fn begin(&self) {
        self.staged.store(0, Ordering::Relaxed);
        self.is_lost.store(false, Ordering::Relaxed);
    }

    /// Puts bytes behind what the instance has sent already.
    pub(crate) fn stage(&self, bytes: &[u8]) {
        let staged = self.staged.load(Ordering::Relaxed);
        if self.is_lost.load(Ordering::Relaxed) || !self.ring.put(staged, bytes) {
            self.is_lost.store(true, Ordering::Relaxed);
        }
        let staged = staged.saturating_add(bytes.len());
        self.staged.store(staged, Ordering::Relaxed);
    }

    /// Takes the next byte that is to go.
    pub(crate) fn take(&self) -> Option<u8> {
        if self.is_empty() {
            return None;
        }
        let mut byte = [0];
        self.ring.peek(0, &mut byte);
        self.ring.drop(1);
        Some(byte[0])
    }

    /// Reports whether nothing is to go.
    pub(crate) fn is_empty(&self) -> bool {
        self.ring.waiting(self.ring.written()) == 0
    }
}

/// What the sender's completion does.
pub(crate) struct Departure(pub(crate) Arc<Outgoing>);

impl Effect for Departure {
    fn happen(&mut self, _completed_ns: u64, _ask: &mut dyn FnMut(Request)) {
        let outgoing = &*self.0;
        let staged = outgoing.staged.load(Ordering::Relaxed);
        if outgoing.is_lost.load(Ordering::Relaxed) {
            outgoing.lost.add(staged);
        } else {
            outgoing.ring.show(staged);
            outgoing.sent.add(staged);
        }
        outgoing.begin();
    }
}
