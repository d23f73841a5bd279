//! A ring of events, from the cores on which they happen to the one that drains it.
//!
//! One side writes at a time, under the scheduler's lock, and one reads; neither waits.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

/// Stands where a release does, for: it is not known.
const UNKNOWN: u64 = u64::MAX;

/// The words of an event.
pub(super) const WORDS: usize = 4;

struct Ring {
    places: Box<[[AtomicU64; WORDS]]>,
    /// How many events have been written, and read, in all.
    written: AtomicUsize,
    read: AtomicUsize,
}

/// The writing end.
pub(super) struct EventWriter(Arc<Ring>);

/// The reading end.
pub(super) struct EventReader(Arc<Ring>);

/// What has happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Event {
    /// What, and to whom.
    pub(super) tag: u64,
    pub(super) job: u64,
    pub(super) at_ns: u64,
    /// When the job was due, where it is known.
    pub(super) release_ns: Option<u64>,
}

/// Makes a ring of so many events; `None`: there is no memory.
pub(super) fn ring(count: usize) -> Option<(EventWriter, EventReader)> {
    let mut places = Vec::new();
    places.try_reserve_exact(count).ok()?;
    places.resize_with(count, || [const { AtomicU64::new(0) }; WORDS]);
    let ring = Arc::new(Ring {
        places: places.into(),
        written: AtomicUsize::new(0),
        read: AtomicUsize::new(0),
    });
    Some((EventWriter(Arc::clone(&ring)), EventReader(ring)))
}

impl Ring {
    fn place(&self, number: usize) -> Option<&[AtomicU64; WORDS]> {
        self.places.get(number.checked_rem(self.places.len())?)
    }
}

impl EventWriter {
    /// Writes an event; `false`: it has no room.
    pub(super) fn put(&mut self, event: &Event) -> bool {
        let ring = &*self.0;
        let written = ring.written.load(Ordering::Relaxed);
        let read = ring.read.load(Ordering::Acquire);
        let Some(place) = (ring.place(written)).filter(|_| written - read < ring.places.len())
        else {
            return false;
        };
        let release_ns = event.release_ns.unwrap_or(UNKNOWN);
        let words = [event.tag, event.job, event.at_ns, release_ns];
        for (place, word) in place.iter().zip(words) {
            place.store(word, Ordering::Relaxed);
        }
        ring.written.store(written + 1, Ordering::Release);
        true
    }
}

impl EventReader {
    /// Returns the next event, if there is one.
    pub(super) fn next(&self) -> Option<Event> {
        let ring = &*self.0;
        let read = ring.read.load(Ordering::Relaxed);
        if read == ring.written.load(Ordering::Acquire) {
            return None;
        }
        let words = ring.place(read)?.each_ref();
        let [tag, job, at_ns, release_ns] = words.map(|word| word.load(Ordering::Relaxed));
        Some(Event {
            tag,
            job,
            at_ns,
            release_ns: (release_ns != UNKNOWN).then_some(release_ns),
        })
    }

    /// Gives its place back.
    pub(super) fn forget(&mut self) {
        let read = self.0.read.load(Ordering::Relaxed);
        self.0.read.store(read + 1, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fits_comes_out_in_order_and_what_does_not_is_refused() {
        let (mut writer, mut reader) = ring(7).expect("there is memory");
        let (mut next, mut taken, mut refused) = (0_u64, 0_u64, 0);
        let event = |job: u64| Event {
            tag: 3 * job,
            job,
            at_ns: job + 1,
            release_ns: job.is_multiple_of(2).then_some(job),
        };
        for round in 0..1000 {
            match writer.put(&event(next)) {
                true => next += 1,
                false => refused += 1,
            }
            if round % 5 >= 2
                && let Some(found) = reader.next()
            {
                assert_eq!(found, event(taken));
                reader.forget();
                taken += 1;
            }
        }
        assert!(refused > 100 && taken > 500, "{refused} {taken}");
        assert!((6..=7).contains(&(next - taken)), "it is full");
    }
}
