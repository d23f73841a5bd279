//! The events of one core, the latest ones only.

use core::sync::atomic::{AtomicU64, Ordering};

use alloc::boxed::Box;

use sched_dag::{CoreId, DagId, SubtaskId};

use super::{Event, What};

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
}

const NO_SUBTASK: u64 = 0xffff_ffff;

/// What is written, by number; the inverse of `What as u8`.
const WHATS: [What; 14] = [
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
];

impl Ring {
    pub(super) fn new(capacity: usize) -> Self {
        let empty = || [const { AtomicU64::new(0) }; 4];
        Self {
            events: (0..capacity).map(|_| empty()).collect(),
            written: AtomicU64::new(0),
        }
    }

    pub(super) fn push(&self, event: Event) {
        let written = self.written.load(Ordering::Relaxed);
        let Some(place) = self.events.get(self.index(written)) else {
            return;
        };
        let subtask = event
            .subtask
            .map_or(NO_SUBTASK, |subtask| u64::from(subtask.0));
        let words = [
            event.time_ns,
            event.job,
            u64::from(event.dag.0) << 32 | subtask,
            u64::from(event.core.0) << 8 | event.what as u64,
        ];
        for (place, word) in place.iter().zip(words) {
            place.store(word, Ordering::Relaxed);
        }
        self.written.store(written + 1, Ordering::Release);
    }

    pub(super) fn clear(&self) {
        self.written.store(0, Ordering::Release);
    }

    /// Returns how many events made way for later ones.
    pub(super) fn lost(&self) -> u64 {
        let written = self.written.load(Ordering::Acquire);
        written.saturating_sub(self.events.len() as u64)
    }

    /// Returns the events that are left, the oldest first.
    pub(super) fn iter(&self) -> impl Iterator<Item = Event> {
        let written = self.written.load(Ordering::Acquire);
        (self.lost()..written).filter_map(|number| self.read(number))
    }

    fn read(&self, number: u64) -> Option<Event> {
        let words = self.events.get(self.index(number))?;
        let [time_ns, job, ids, rest] = words.each_ref().map(|word| word.load(Ordering::Relaxed));
        let [dag, subtask] = [ids >> 32, ids & 0xffff_ffff].map(|id| u32::try_from(id).ok());
        Some(Event {
            time_ns,
            what: *WHATS.get(usize::try_from(rest & 0xff).ok()?)?,
            core: CoreId(u32::try_from(rest >> 8).ok()?),
            dag: DagId(dag?),
            job,
            subtask: subtask
                .filter(|id| u64::from(*id) != NO_SUBTASK)
                .map(SubtaskId),
        })
    }

    fn index(&self, number: u64) -> usize {
        // A ring holds far fewer than 2^32 events.
        usize::try_from(number % (self.events.len() as u64).max(1)).unwrap_or(usize::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(time_ns: u64, what: What, subtask: Option<u32>) -> Event {
        Event {
            time_ns,
            what,
            core: CoreId(3),
            dag: DagId(2),
            job: time_ns + 1,
            subtask: subtask.map(SubtaskId),
        }
    }

    #[test]
    fn keeps_the_latest_events_and_counts_the_lost_ones() {
        let ring = Ring::new(3);
        assert_eq!(ring.iter().count(), 0);
        let events: Vec<_> = (0..5)
            .map(|time| event(time, What::Ready, Some(7)))
            .collect();
        events.iter().for_each(|event| ring.push(*event));
        assert_eq!(ring.lost(), 2);
        assert!(ring.iter().eq(events[2..].iter().copied()));
        ring.clear();
        assert_eq!((ring.iter().count(), ring.lost()), (0, 0));
    }

    #[test]
    fn reads_back_every_kind_of_event() {
        let ring = Ring::new(WHATS.len());
        for (number, what) in (0..).zip(WHATS) {
            assert_eq!(what as u64, number, "{what:?} stands at its number");
            ring.push(event(number, what, (number % 2 == 0).then_some(9)));
        }
        let read: Vec<_> = ring
            .iter()
            .map(|event| (event.what, event.subtask))
            .collect();
        let expected = (0..)
            .zip(WHATS)
            .map(|(number, what)| (what, (number % 2 == 0).then_some(SubtaskId(9))));
        assert!(read.into_iter().eq(expected));
    }

    #[test]
    fn a_ring_without_room_takes_nothing() {
        let ring = Ring::new(0);
        ring.push(event(1, What::Start, None));
        assert_eq!(ring.iter().count(), 0);
    }
}
