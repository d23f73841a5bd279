//! The messages of one topic, oldest arrival first, and how far a search got.
//!
//! A *cursor* parts them: those before it are *passed*, those from it on are
//! *waiting*. The first waiting one is the *head*. Entries leave at the front.

use alloc::collections::VecDeque;

use crate::Stamped;

/// The ring of one topic.
#[derive(Debug)]
pub(super) struct Ring<M> {
    entries: VecDeque<Stamped<M>>,
    cursor: usize,
    /// Whether an entry was discarded for want of room, and nothing since has shown
    /// that this could not have hidden a better set.
    pub(super) lossy: bool,
}

impl<M> Ring<M> {
    /// Makes an empty ring with room for `entries` entries.
    pub(super) fn with_capacity(entries: usize) -> Self {
        Self {
            entries: VecDeque::with_capacity(entries),
            cursor: 0,
            lossy: false,
        }
    }

    pub(super) fn len(&self) -> usize {
        self.entries.len()
    }

    pub(super) fn append(&mut self, entry: Stamped<M>) {
        self.entries.push_back(entry);
    }

    /// Returns the stamp of the first waiting entry.
    pub(super) fn head_ns(&self) -> Option<i128> {
        Some(self.entries.get(self.cursor)?.stamp_ns.into())
    }

    /// Returns the stamp of the last passed entry.
    pub(super) fn last_passed_ns(&self) -> Option<i128> {
        let position = self.cursor.checked_sub(1)?;
        Some(self.entries.get(position)?.stamp_ns.into())
    }

    /// Makes the head passed. Nothing leaves.
    pub(super) fn advance(&mut self) {
        debug_assert!(self.cursor < self.entries.len(), "no head to advance over");
        self.cursor += 1;
    }

    /// Makes all entries waiting again.
    pub(super) fn rewind(&mut self) {
        self.cursor = 0;
    }

    pub(super) fn cursor(&self) -> usize {
        self.cursor
    }

    /// Takes a cursor back to where [`cursor`](Self::cursor) said it was; nothing
    /// has left meanwhile.
    pub(super) fn restore(&mut self, cursor: usize) {
        self.cursor = cursor;
    }

    /// Removes the front entry, which the cursor must not depend on.
    pub(super) fn take_front(&mut self) -> Option<Stamped<M>> {
        debug_assert!(self.cursor == 0, "the front may be passed: rewind first");
        self.entries.pop_front()
    }

    /// Removes the first passed entry.
    pub(super) fn take_passed(&mut self) -> Option<Stamped<M>> {
        self.cursor = self.cursor.checked_sub(1)?;
        self.entries.pop_front()
    }
}
