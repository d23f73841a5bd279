//! A ring of words, from the cores that complete to the one that drains it.
//!
//! One side writes at a time, under the scheduler's lock, and one reads; neither waits. A record
//! lies in one piece: three words, and its bytes.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};

/// The words of a record before its bytes.
const HEAD: usize = 3;

/// Stands where a record's first word does, for: the next one is at the start.
const WRAP: u64 = u64::MAX;

struct Ring {
    /// A power of two.
    words: Box<[AtomicU64]>,
    /// How many words have been written, and read, in all.
    written: AtomicUsize,
    read: AtomicUsize,
    /// Whether nothing is written any more.
    is_closed: AtomicBool,
}

/// The writing end.
pub(super) struct RingWriter {
    ring: Arc<Ring>,
    written: usize,
    /// What had been read at the last look.
    read: usize,
}

/// The reading end.
pub(super) struct RingReader {
    ring: Arc<Ring>,
    read: usize,
}

/// A record without its bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Head {
    /// What it is; 40 bits.
    pub(super) tag: u64,
    pub(super) job: u64,
    pub(super) at_ns: u64,
}

/// Makes a ring of at least so many bytes; `None`: there is no memory.
pub(super) fn ring(bytes: usize) -> Option<(RingWriter, RingReader)> {
    let count = (bytes / 8).checked_next_power_of_two()?;
    let mut words = Vec::new();
    words.try_reserve_exact(count).ok()?;
    words.resize_with(count, || AtomicU64::new(0));
    let ring = Arc::new(Ring {
        words: words.into(),
        written: AtomicUsize::new(0),
        read: AtomicUsize::new(0),
        is_closed: AtomicBool::new(false),
    });
    let writer = RingWriter {
        ring: Arc::clone(&ring),
        written: 0,
        read: 0,
    };
    Some((writer, RingReader { ring, read: 0 }))
}

impl RingWriter {
    /// Writes a record, and leaves room for `kept` words; `false`: it has no room.
    ///
    /// Each recorded value comes by here, and this crate is compiled for size: so it is made part
    /// of what calls it, and copies by eight.
    #[inline(always)]
    pub(super) fn put(&mut self, head: Head, bytes: &[u8], kept: usize) -> bool {
        // Shorter than `div_ceil`; no slice is so long that it overflows.
        let count = HEAD + ((bytes.len() + 7) >> 3);
        let size = self.ring.words.len();
        let mut place = self.written & (size - 1);
        let end = self.written.wrapping_add(count + kept);
        if place + count > size || end.wrapping_sub(self.read) > size {
            if !self.make_room(count, kept) {
                return false;
            }
            place = self.written & (size - 1);
        }
        let words = self.ring.words.get(place..place + count);
        let Some([tag, job, at, rest @ ..]) = words else {
            return false;
        };
        // A record is shorter than the ring, so its length has 24 bits or fewer.
        tag.store(head.tag | (bytes.len() as u64) << 40, Ordering::Relaxed);
        job.store(head.job, Ordering::Relaxed);
        at.store(head.at_ns, Ordering::Relaxed);
        copy(bytes, rest);
        self.written = self.written.wrapping_add(count);
        self.ring.written.store(self.written, Ordering::Release);
        true
    }

    /// Does the same, apart, for what happens seldom.
    #[cold]
    pub(super) fn put_seldom(&mut self, head: Head, bytes: &[u8], kept: usize) -> bool {
        self.put(head, bytes, kept)
    }

    /// Goes to the start if that is where the next `count` words lie; `false`: they have no room.
    #[cold]
    fn make_room(&mut self, count: usize, kept: usize) -> bool {
        let words = &*self.ring.words;
        let place = self.written & (words.len() - 1);
        let left = words.len() - place;
        let skipped = if count > left { left } else { 0 };
        self.read = self.ring.read.load(Ordering::Acquire);
        let end = self.written.wrapping_add(skipped + count + kept);
        if end.wrapping_sub(self.read) > words.len() {
            return false;
        }
        if skipped > 0 {
            words[place].store(WRAP, Ordering::Relaxed);
            self.written = self.written.wrapping_add(skipped);
        }
        true
    }

    pub(super) fn close(&self) {
        self.ring.is_closed.store(true, Ordering::Release);
    }

    pub(super) fn is_closed(&self) -> bool {
        self.ring.is_closed.load(Ordering::Relaxed)
    }
}

/// Copies bytes into words, of which there are as many as are needed.
#[inline(always)]
fn copy(bytes: &[u8], words: &[AtomicU64]) {
    let (eights, _) = bytes.as_chunks::<64>();
    for (bytes, words) in eights.iter().zip(words.as_chunks().0) {
        let [a, b, c, d, e, f, g, h]: &[AtomicU64; 8] = words;
        let ([b_0, b_1, b_2, b_3, b_4, b_5, b_6, b_7], _) = bytes.as_chunks() else {
            continue;
        };
        put(a, b_0);
        put(b, b_1);
        put(c, b_2);
        put(d, b_3);
        put(e, b_4);
        put(f, b_5);
        put(g, b_6);
        put(h, b_7);
    }
    if !bytes.len().is_multiple_of(64) {
        copy_few(&bytes[64 * eights.len()..], &words[8 * eights.len()..]);
    }
}

/// Copies fewer than 64 bytes.
#[inline(never)]
fn copy_few(bytes: &[u8], words: &[AtomicU64]) {
    let (whole, last) = bytes.as_chunks();
    for (word, bytes) in words.iter().zip(whole) {
        put(word, bytes);
    }
    if let (false, Some(word)) = (last.is_empty(), words.last()) {
        let mut bytes = [0; 8];
        bytes[..last.len()].copy_from_slice(last);
        put(word, &bytes);
    }
}

#[inline(always)]
fn put(word: &AtomicU64, bytes: &[u8; 8]) {
    word.store(u64::from_le_bytes(*bytes), Ordering::Relaxed);
}

impl RingReader {
    pub(super) fn is_closed(&self) -> bool {
        self.ring.is_closed.load(Ordering::Acquire)
    }

    /// Takes the next record, if there is one: `look` gets its bytes in words, and their number.
    pub(super) fn take(&mut self, look: impl FnOnce(Head, &[AtomicU64], usize)) -> bool {
        let words = &*self.ring.words;
        if self.read == self.ring.written.load(Ordering::Acquire) {
            return false;
        }
        let mut place = self.read & (words.len() - 1);
        if words[place].load(Ordering::Relaxed) == WRAP {
            self.read = self.read.wrapping_add(words.len() - place);
            place = 0;
        }
        let of = |number: usize| words[place + number].load(Ordering::Relaxed);
        let length = usize::try_from(of(0) >> 40).unwrap_or(0);
        let count = HEAD + length.div_ceil(8);
        let head = Head {
            tag: of(0) & ((1 << 40) - 1),
            job: of(1),
            at_ns: of(2),
        };
        look(head, &words[place + HEAD..place + count], length);
        self.read = self.read.wrapping_add(count);
        self.ring.read.store(self.read, Ordering::Release);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a record of the test holds.
    fn content(job: u64) -> impl Iterator<Item = u8> {
        let [low, ..] = job.to_le_bytes();
        (0..=u8::MAX).map(move |place| place ^ low)
    }

    #[test]
    fn what_fits_comes_out_in_order_and_what_does_not_is_refused() {
        let (mut writer, mut reader) = ring(600).unwrap();
        let (mut next, mut taken, mut refused) = (0_u64, 0_u64, 0);
        for round in 0..1000_u64 {
            let length = usize::try_from(round * 7 % 151).unwrap();
            let bytes: Vec<u8> = content(next).take(length).collect();
            let head = Head {
                tag: length as u64,
                job: next,
                at_ns: round,
            };
            match writer.put(head, &bytes, 0) {
                true => next += 1,
                false => refused += 1,
            }
            if round % 5 < 2 {
                continue;
            }
            reader.take(|head, words, length| {
                assert_eq!((head.job, head.tag), (taken, length as u64));
                let words = words.iter().map(|word| word.load(Ordering::Relaxed));
                let bytes: Vec<u8> = words.flat_map(u64::to_le_bytes).collect();
                assert!(
                    bytes
                        .into_iter()
                        .take(length)
                        .eq(content(taken).take(length))
                );
                taken += 1;
            });
        }
        assert!(
            refused > 100 && taken > 500,
            "{refused} refused, {taken} taken"
        );
        while reader.take(|head, _, _| {
            assert_eq!(head.job, taken);
            taken += 1;
        }) {}
        assert_eq!(taken, next);
    }

    #[test]
    fn what_is_kept_free_is_for_others() {
        let (mut writer, _reader) = ring(64).unwrap();
        let head = Head {
            tag: 0,
            job: 0,
            at_ns: 0,
        };
        assert!(!writer.put(head, &[0; 24], 3), "8 words, 3 of them kept");
        assert!(writer.put(head, &[0; 16], 3));
        assert!(writer.put(head, &[], 0));
    }
}
