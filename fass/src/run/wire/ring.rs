//! A ring of bytes from one side that writes to one that reads, perhaps on another core.
//!
//! Bytes are put *ahead* of what is written, in any number of steps, and are there for the
//! reader when they are *shown*, all at once. Neither side ever waits. Each byte is an atomic
//! word, so nothing here is `unsafe`; that the reader finds what was put follows from the
//! `Release` store that shows it.

use alloc::boxed::Box;
use core::sync::atomic::{AtomicU8, AtomicUsize, Ordering};

pub(super) struct Ring {
    /// A power of two.
    bytes: Box<[AtomicU8]>,
    /// How many bytes have ever been shown, and how many of them taken.
    written: AtomicUsize,
    read: AtomicUsize,
}

impl Ring {
    /// Makes a ring with room for so many bytes at least.
    pub(super) fn new(room_bytes: usize) -> Self {
        let room = room_bytes.max(16).next_power_of_two();
        Self {
            bytes: (0..room).map(|_| AtomicU8::new(0)).collect(),
            written: AtomicUsize::new(0),
            read: AtomicUsize::new(0),
        }
    }

    #[inline(always)]
    fn place(&self, at: usize) -> &AtomicU8 {
        &self.bytes[at & (self.bytes.len() - 1)]
    }

    /// Puts bytes so far ahead of what is written. Reports whether there was room for them.
    pub(super) fn put(&self, ahead: usize, bytes: &[u8]) -> bool {
        let written = self.written.load(Ordering::Relaxed);
        let used = written.wrapping_sub(self.read.load(Ordering::Acquire));
        if bytes.len() > self.bytes.len().saturating_sub(used + ahead) {
            return false;
        }
        let mut at = written.wrapping_add(ahead);
        for byte in bytes {
            self.place(at).store(*byte, Ordering::Relaxed);
            at = at.wrapping_add(1);
        }
        true
    }

    /// Returns the byte that was put so far ahead of what is written.
    pub(super) fn ahead(&self, ahead: usize) -> u8 {
        let at = self.written.load(Ordering::Relaxed).wrapping_add(ahead);
        self.place(at).load(Ordering::Relaxed)
    }

    /// Shows so many bytes, which were put.
    pub(super) fn show(&self, count: usize) {
        let written = self.written.load(Ordering::Relaxed);
        self.written
            .store(written.wrapping_add(count), Ordering::Release);
    }

    /// Returns how many bytes have ever been shown.
    pub(super) fn written(&self) -> usize {
        self.written.load(Ordering::Acquire)
    }

    /// Returns how many of those shown by `until` are there.
    pub(super) fn waiting(&self, until: usize) -> usize {
        until.wrapping_sub(self.read.load(Ordering::Relaxed))
    }

    /// Looks at bytes that are there, from so many after the first.
    pub(super) fn peek(&self, after: usize, bytes: &mut [u8]) {
        let read = self.read.load(Ordering::Relaxed);
        for (at, byte) in (read.wrapping_add(after)..).zip(bytes) {
            *byte = self.place(at).load(Ordering::Relaxed);
        }
    }

    /// Takes so many bytes out.
    pub(super) fn drop(&self, count: usize) {
        let read = self.read.load(Ordering::Relaxed);
        self.read.store(read.wrapping_add(count), Ordering::Release);
    }
}
