//! The events of one core, the latest ones only.

use core::sync::atomic::{AtomicU64, Ordering, fence};

use alloc::boxed::Box;

use sched_dag::CoreId;

use super::{Event, Subject, What};

/// One event: time, job, DAG and subtask, core and what happened.
type Words = [AtomicU64; 4];

/// A bounded list of events in which the oldest make way.
///
/// Only its core writes; all may read while nothing is written.
#[derive(Debug)]
pub(super) struct Ring {
    events: Box<[Words]>,
    /// How many events were ever written since the last [`clear`](Self::clear).
    written: AtomicU64,
    /// What an event on its core has in its last word, besides what happened:
    /// the core, and [`NOT_KEPT`] while recording is off.
    own: AtomicU64,
    /// The number of the first event that was not forgotten.
    first: AtomicU64,
}

/// Stands where the number of a [`What`] does, and is none.
const NOT_KEPT: u64 = 0xff;

/// What is written, by number; the inverse of `What as u8`.
const WHATS: [What; 16] = [
    What::Released,
    What::Queued,
    What::Skipped,
    What::Aborted,
    What::Missed,
    What::Completed,
    What::Ready,
    What::Cancelled,
    What::Request,
    What::Start,
    What::Suspend,
    What::Resume,
    What::Finish,
    What::Ended,
    What::Signalled,
    What::Dropped,
];

impl Ring {
    /// What an event takes.
    pub(super) const EVENT_BYTES: usize = size_of::<[AtomicU64; 4]>();

    /// Makes the ring of a core, with room for `capacity` events, a power of two or 0.
    pub(super) fn new(core: CoreId, capacity: usize) -> Self {
        debug_assert!(capacity == 0 || capacity.is_power_of_two());
        let empty = || [const { AtomicU64::new(0) }; 4];
        Self {
            events: (0..capacity).map(|_| empty()).collect(),
            written: AtomicU64::new(0),
            own: AtomicU64::new(last_word(core)),
            first: AtomicU64::new(0),
        }
    }

    /// Writes an event on the ring's core; while recording is off, counts it only.
    #[inline]
    pub(super) fn push_own(&self, what: What, time_ns: u64, subject: Subject) {
        let own = self.own.load(Ordering::Relaxed);
        self.write([time_ns, subject.job, subject.ids, own | what as u64]);
    }

    /// Writes an event that may be for another core.
    pub(super) fn push(&self, event: &Event) {
        let Event {
            time_ns,
            what,
            core,
            subject,
        } = *event;
        let not_kept = self.own.load(Ordering::Relaxed) & NOT_KEPT;
        let last = last_word(core) | not_kept | what as u64;
        self.write([time_ns, subject.job, subject.ids, last]);
    }

    #[inline]
    fn write(&self, event: [u64; 4]) {
        let written = self.written.load(Ordering::Relaxed);
        let Some(words) = self.events.get(self.index(written)) else {
            return;
        };
        for (word, value) in words.iter().zip(event) {
            word.store(value, Ordering::Relaxed);
        }
        self.written.store(written + 1, Ordering::Release);
    }

    /// Begins anew. Not while events are written.
    pub(super) fn clear(&self) {
        self.first.store(0, Ordering::Release);
        self.written.store(0, Ordering::Release);
    }

    /// Records events from now on, or not, and forgets those up to now, which count
    /// as lost. May be called while events are written.
    pub(super) fn record_events(&self, on: bool) {
        if !on {
            self.own.fetch_or(NOT_KEPT, Ordering::Relaxed);
        }
        let written = self.written.load(Ordering::Acquire);
        self.first.store(written, Ordering::Release);
        if on {
            self.own.fetch_and(!NOT_KEPT, Ordering::Release);
        }
    }

    /// Reports whether events are recorded.
    pub(super) fn is_on(&self) -> bool {
        self.own.load(Ordering::Relaxed) & NOT_KEPT == 0
    }

    /// Reports whether an event has room.
    pub(super) fn has_room(&self) -> bool {
        !self.events.is_empty()
    }

    /// Returns how many events are not there any more: they made way for later
    /// ones, were forgotten, or were not kept.
    pub(super) fn lost(&self) -> u64 {
        let written = self.written.load(Ordering::Acquire);
        written.saturating_sub(self.iter().count() as u64)
    }

    /// Returns the events that are left, the oldest first.
    pub(super) fn iter(&self) -> impl Iterator<Item = Event> {
        let written = self.written.load(Ordering::Acquire);
        (self.oldest(written)..written).filter_map(|number| self.read(number))
    }

    /// Does as [`iter`](Self::iter) for the latest `most` events while events are
    /// written: leaves out the ones that are overwritten meanwhile.
    pub(super) fn iter_meanwhile(&self, most: u64) -> impl Iterator<Item = Event> {
        let written = self.written.load(Ordering::Acquire);
        let oldest = self.oldest(written).max(written.saturating_sub(most));
        (oldest..written).filter_map(|number| {
            let event = self.read(number)?;
            // The words were read before the number of the latest event is.
            fence(Ordering::Acquire);
            let written = self.written.load(Ordering::Relaxed);
            // Where it is equal, the very place may just be written.
            (written < number + self.events.len() as u64).then_some(event)
        })
    }

    /// Reports whether the latest `most` events are all that ever happened.
    pub(super) fn is_whole(&self, most: u64) -> bool {
        let written = self.written.load(Ordering::Acquire);
        self.oldest(written) == 0 && written <= most
    }

    /// Returns the number of the oldest event that may be there.
    fn oldest(&self, written: u64) -> u64 {
        let kept = written.saturating_sub(self.events.len() as u64);
        kept.max(self.first.load(Ordering::Acquire))
    }

    fn read(&self, number: u64) -> Option<Event> {
        let words = self.events.get(self.index(number))?;
        let [time_ns, job, ids, last] = words.each_ref().map(|word| word.load(Ordering::Relaxed));
        Some(Event {
            time_ns,
            what: *WHATS.get(usize::try_from(last & 0xff).ok()?)?,
            core: CoreId(u32::try_from(last >> 8).ok()?),
            subject: Subject { ids, job },
        })
    }

    /// Returns an event's place: a mask, as the length is a power of two, or 0.
    #[inline]
    fn index(&self, number: u64) -> usize {
        let mask = (self.events.len() as u64).wrapping_sub(1);
        #[allow(
            clippy::cast_possible_truncation,
            reason = "less than the length, unless that is 0"
        )]
        {
            (number & mask) as usize
        }
    }
}

/// Returns an event's last word without what happened.
fn last_word(core: CoreId) -> u64 {
    u64::from(core.0) << 8
}

#[cfg(test)]
mod tests {
    use sched_dag::{DagId, Instance, SubtaskId};

    use super::*;

    fn event(time_ns: u64, what: What, subtask: Option<u32>) -> Event {
        let (dag, job) = (DagId(2), time_ns + 1);
        let of = |subtask| {
            Subject::of(Instance {
                dag,
                job,
                subtask: SubtaskId(subtask),
            })
        };
        Event {
            time_ns,
            what,
            core: CoreId(3),
            subject: subtask.map_or(Subject::of_job(dag, job), of),
        }
    }

    #[test]
    fn an_event_on_the_own_core_is_like_any_other() {
        let [own, any] = [(); 2].map(|()| Ring::new(CoreId(3), 2));
        for is_on in [true, false, true] {
            let event = event(4, What::Finish, Some(7));
            own.record_events(is_on);
            any.record_events(is_on);
            own.push_own(event.what, event.time_ns, event.subject);
            any.push(&event);
            assert!(own.iter().eq(any.iter()));
            assert_eq!(own.iter().count(), usize::from(is_on));
        }
    }

    #[test]
    fn keeps_the_latest_events_and_counts_the_lost_ones() {
        let ring = Ring::new(CoreId(3), 4);
        assert_eq!(ring.iter().count(), 0);
        let events: Vec<_> = (0..6)
            .map(|time| event(time, What::Ready, Some(7)))
            .collect();
        events.iter().for_each(|event| ring.push(event));
        assert_eq!(ring.lost(), 2);
        assert!(ring.iter().eq(events[2..].iter().copied()));
        ring.clear();
        assert_eq!((ring.iter().count(), ring.lost()), (0, 0));
    }

    #[test]
    fn reads_back_every_kind_of_event() {
        let ring = Ring::new(CoreId(3), WHATS.len().next_power_of_two());
        for (number, what) in (0..).zip(WHATS) {
            assert_eq!(what as u64, number, "{what:?} stands at its number");
            ring.push(&event(number, what, (number % 2 == 0).then_some(9)));
        }
        let read: Vec<_> = ring
            .iter()
            .map(|event| (event.what, event.subject.subtask()))
            .collect();
        let expected = (0..)
            .zip(WHATS)
            .map(|(number, what)| (what, (number % 2 == 0).then_some(SubtaskId(9))));
        assert!(read.into_iter().eq(expected));
    }

    #[test]
    fn what_is_forgotten_or_not_kept_counts_as_lost() {
        let ring = Ring::new(CoreId(3), 4);
        ring.push(&event(0, What::Ready, None));
        ring.push(&event(1, What::Ready, None));
        ring.record_events(false);
        assert_eq!((ring.iter().count(), ring.lost()), (0, 2));
        ring.push(&event(2, What::Ready, None));
        assert_eq!((ring.iter().count(), ring.lost()), (0, 3));
        ring.record_events(true);
        ring.push(&event(3, What::Ready, None));
        let times = |ring: &Ring| ring.iter().map(|event| event.time_ns).collect::<Vec<_>>();
        assert_eq!((times(&ring), ring.lost()), (vec![3], 3));
        (4..9).for_each(|time| ring.push(&event(time, What::Ready, None)));
        assert_eq!((times(&ring), ring.lost()), (vec![5, 6, 7, 8], 5));
        ring.clear();
        assert_eq!((ring.iter().count(), ring.lost()), (0, 0));
    }

    #[test]
    fn whoever_reads_meanwhile_leaves_out_what_may_be_overwritten() {
        let ring = Ring::new(CoreId(3), 4);
        (0..4).for_each(|time| ring.push(&event(time, What::Ready, None)));
        let times: Vec<_> = ring.iter_meanwhile(9).map(|event| event.time_ns).collect();
        assert_eq!(times, [1, 2, 3]);
        let latest = ring.iter_meanwhile(1).next();
        assert_eq!(latest.map(|event| event.time_ns), Some(3));
        assert!(ring.is_whole(4) && !ring.is_whole(3));
        let mut reader = ring.iter_meanwhile(9);
        ring.push(&event(4, What::Ready, None));
        assert_eq!(reader.next().map(|event| event.time_ns), Some(2));
    }

    #[test]
    fn a_ring_without_room_takes_nothing() {
        let ring = Ring::new(CoreId(3), 0);
        ring.push(&event(1, What::Start, None));
        assert_eq!(ring.iter().count(), 0);
    }
}
