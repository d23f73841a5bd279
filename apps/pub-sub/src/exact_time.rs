//! Equal stamps make a set.
//!
//! An *entry* is a stamp with a slot for each topic. A message goes into its
//! topic's slot of its stamp's entry. The numbered steps, which the tests are
//! named after:
//!
//! 1. Entries are ordered by stamp. A message whose slot is taken replaces the
//!    older one, silently.
//! 2. An entry with all slots full is emitted and deleted; then every entry with a
//!    smaller stamp is dropped. Newer entries stay.
//! 3. While there are more entries than the queue size, the one with the smallest
//!    stamp is dropped, even if the message that just arrived made it. So a topic
//!    more than a queue's length of stamps behind can never match again.
//! 4. Nothing is refused for being old: a late stamp makes a new entry that may
//!    still be completed, so the stamps of successive sets can go backwards.
//!
//! Storage for the queue size plus one entries is reserved at construction. The
//! order is kept in a ring of (stamp, place) pairs, so that an arrival costs a
//! binary search, and moves at most half of those pairs when it makes an entry in
//! the middle. Without a limit the storage grows with the largest backlog.

use alloc::collections::VecDeque;
use alloc::vec::Vec;

use crate::{Outlet, Set, Stamped, Synchronizer};

/// The policy that makes sets of equal stamps.
///
/// ```
/// use pub_sub::{ExactTime, Outlet, Set, Stamped, Synchronizer};
///
/// struct Print;
/// impl Outlet<&str> for Print {
///     fn emitted(&mut self, set: Set<'_, &str>) {
///         let words: Vec<_> = set.map(|stamped| stamped.message).collect();
///         assert_eq!(words, ["left", "right"]);
///     }
/// }
///
/// let mut exact = ExactTime::new(2, 10);
/// let at = |stamp_ns, message| Stamped { stamp_ns, message };
/// exact.arrive(1, at(7, "right"), &mut Print);
/// exact.arrive(0, at(7, "left"), &mut Print);
/// assert_eq!((exact.held(0), exact.held(1)), (0, 0));
/// ```
#[derive(Debug)]
pub struct ExactTime<M> {
    topics: usize,
    /// 0 for no limit.
    queue_size: usize,
    /// In ascending order of the stamp, each stamp once.
    entries: VecDeque<Entry>,
    /// The slots of all entries; entry e has those from `e.slots` on.
    slots: Vec<Option<M>>,
    /// Where slots are that no entry has.
    free: Vec<usize>,
    /// The set being emitted; otherwise empty.
    set: Vec<Stamped<M>>,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    stamp_ns: u64,
    /// The position of topic 0's slot.
    slots: usize,
    /// How many slots are full, at least one.
    full: usize,
}

impl<M> ExactTime<M> {
    /// Makes a synchronizer that keeps at most `queue_size` incomplete sets; 0 is no
    /// limit. It holds at most that many messages of a topic between arrivals.
    ///
    /// # Panics
    ///
    /// If `topics` is 0, or memory does not suffice for `topics * (queue_size + 1)`
    /// messages.
    #[must_use]
    pub fn new(topics: usize, queue_size: usize) -> Self {
        assert!(
            topics > 0,
            "a synchronizer needs a topic; give it at least 1"
        );
        let entries = match queue_size {
            0 => 0,
            _ => queue_size.saturating_add(1),
        };
        let mut slots = Vec::with_capacity(topics.saturating_mul(entries));
        slots.resize_with(topics * entries, || None);
        Self {
            topics,
            queue_size,
            entries: VecDeque::with_capacity(entries),
            slots,
            free: (0..entries).rev().map(|entry| entry * topics).collect(),
            set: Vec::with_capacity(topics),
        }
    }

    /// Returns the position of a stamp's entry, which it makes if there is none.
    fn entry(&mut self, stamp_ns: u64) -> usize {
        let known = self
            .entries
            .binary_search_by_key(&stamp_ns, |entry| entry.stamp_ns);
        known.unwrap_or_else(|position| {
            let slots = self.free.pop().unwrap_or_else(|| {
                // Only without a limit: all that a limit allows is reserved.
                let slots = self.slots.len();
                self.slots.resize_with(slots + self.topics, || None);
                slots
            });
            let entry = Entry {
                stamp_ns,
                slots,
                full: 0,
            };
            self.entries.insert(position, entry);
            position
        })
    }

    /// Emits the entry at a position (step 2, first part).
    fn emit(&mut self, position: usize, outlet: &mut dyn Outlet<M>) {
        let Some(entry) = self.entries.remove(position) else {
            return;
        };
        let slots = &mut self.slots[entry.slots..entry.slots + self.topics];
        let messages = slots.iter_mut().filter_map(Option::take);
        self.set.extend(messages.map(|message| Stamped {
            stamp_ns: entry.stamp_ns,
            message,
        }));
        self.free.push(entry.slots);
        outlet.emitted(Set::new(self.set.drain(..)));
    }

    /// Drops the entry with the smallest stamp.
    fn drop_smallest(&mut self, outlet: &mut dyn Outlet<M>) {
        let Some(entry) = self.entries.pop_front() else {
            return;
        };
        let stamp_ns = entry.stamp_ns;
        for topic in 0..self.topics {
            if let Some(message) = self.slots[entry.slots + topic].take() {
                outlet.dropped(topic, Stamped { stamp_ns, message });
            }
        }
        self.free.push(entry.slots);
    }
}

impl<M> Synchronizer<M> for ExactTime<M> {
    fn topics(&self) -> usize {
        self.topics
    }

    fn arrive(&mut self, topic: usize, message: Stamped<M>, outlet: &mut dyn Outlet<M>) {
        assert!(
            topic < self.topics,
            "there is no topic {topic}; there are {}, counted from 0",
            self.topics
        );
        let Stamped { stamp_ns, message } = message;
        let position = self.entry(stamp_ns);
        let entry = &mut self.entries[position];
        match self.slots[entry.slots + topic].replace(message) {
            Some(message) => outlet.replaced(topic, Stamped { stamp_ns, message }),
            None => entry.full += 1,
        }
        if entry.full == self.topics {
            self.emit(position, outlet);
            for _ in 0..position {
                self.drop_smallest(outlet);
            }
        }
        while self.queue_size > 0 && self.entries.len() > self.queue_size {
            self.drop_smallest(outlet);
        }
    }

    fn held(&self, topic: usize) -> usize {
        assert!(topic < self.topics, "there is no topic {topic}");
        let slots = self.entries.iter().map(|entry| entry.slots + topic);
        slots.filter(|&slot| self.slots[slot].is_some()).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synchronizer::Written;

    /// Feeds (topic, stamp); message i is the i-th arrival.
    fn feed(exact: &mut ExactTime<u64>, arrivals: &[(usize, u64)]) -> Written {
        let mut written = Written::default();
        for (message, &(topic, stamp_ns)) in (0..).zip(arrivals) {
            exact.arrive(topic, Stamped { stamp_ns, message }, &mut written);
        }
        written
    }

    #[test]
    fn step_1_the_newer_message_of_a_stamp_replaces_the_older() {
        let written = feed(&mut ExactTime::new(2, 5), &[(0, 7), (0, 7), (1, 7)]);
        assert_eq!(written.sets, [[1, 2]]);
        assert_eq!(written.replaced, [(0, 0)]);
        assert_eq!(written.dropped, []);
    }

    #[test]
    fn step_2_a_full_entry_is_emitted_and_smaller_ones_dropped() {
        let mut exact = ExactTime::new(2, 5);
        let written = feed(&mut exact, &[(0, 2), (0, 1), (1, 4), (0, 3), (1, 3)]);
        assert_eq!(written.sets, [[3, 4]]);
        assert_eq!(written.dropped, [(0, 1), (0, 0)], "ascending");
        assert_eq!(
            (exact.held(0), exact.held(1)),
            (0, 1),
            "the newer one stays"
        );
    }

    #[test]
    fn step_3_too_many_entries_lose_the_smallest_stamp() {
        let written = feed(&mut ExactTime::new(2, 2), &[(0, 1), (0, 2), (0, 3), (1, 1)]);
        assert_eq!(written.sets, [] as [Vec<u64>; 0]);
        assert_eq!(
            written.dropped,
            [(0, 0), (1, 3)],
            "the late message makes the smallest entry, and goes at once"
        );
    }

    #[test]
    fn step_3_a_queue_size_of_0_is_no_limit() {
        let mut exact = ExactTime::new(2, 0);
        let arrivals: Vec<_> = (0..100).map(|stamp| (0, stamp)).chain([(1, 0)]).collect();
        let written = feed(&mut exact, &arrivals);
        assert_eq!(written.sets, [[0, 100]]);
        assert_eq!(exact.held(0), 99);
    }

    #[test]
    fn step_4_stamps_of_sets_can_go_backwards() {
        let written = feed(&mut ExactTime::new(2, 5), &[(0, 9), (1, 9), (0, 4), (1, 4)]);
        assert_eq!(written.sets, [[0, 1], [2, 3]]);
    }

    #[test]
    fn one_topic_is_emitted_at_once() {
        assert_eq!(feed(&mut ExactTime::new(1, 1), &[(0, 3)]).sets, [[0]]);
    }

    #[test]
    fn nothing_is_allocated_after_construction() {
        let mut exact = ExactTime::new(3, 4);
        let capacities = |exact: &ExactTime<u64>| {
            let slots = exact.slots.capacity();
            let (entries, free) = (exact.entries.capacity(), exact.free.capacity());
            (slots, entries, free, exact.set.capacity())
        };
        let before = capacities(&exact);
        let arrivals: Vec<_> = (0..999_usize)
            .map(|i| (i % 3, (i * i % 17) as u64))
            .collect();
        feed(&mut exact, &arrivals);
        assert_eq!(capacities(&exact), before);
    }

    #[test]
    #[should_panic(expected = "there is no topic 2")]
    fn an_unknown_topic_is_refused() {
        feed(&mut ExactTime::new(2, 1), &[(2, 0)]);
    }
}
