//! Equal stamps make a set.
//!
//! An *entry* is a stamp with a slot for each topic. A message goes into its topic's slot of its
//! stamp's entry. `./scripts/oracle synchronizer` compares the numbered steps with traces of the
//! original:
//!
//! 1. Entries are ordered by stamp. A message whose slot is taken replaces the
//!    older one, silently.
//! 2. An entry with all slots full is emitted and deleted; then every entry with a
//!    smaller stamp is dropped. Newer entries stay.
//! 3. While there are more entries than the queue size, the entry with the smallest stamp is
//!    dropped, even if the latest message made it. So a topic lagging by more stamps than the
//!    queue size matches nothing until the lag shrinks.
//! 4. Nothing is refused for being old: a late stamp makes a new entry that may still be completed,
//!    so the stamps of successive sets can go backwards.
//!
//! Storage for the queue size plus one entries is reserved at construction. A ring holds the stamps
//! in order, with their slots elsewhere. So an arrival costs a binary search, and moves at most
//! half of the ring when it makes an entry in the middle. Without a limit the storage grows with
//! the largest backlog.

use alloc::collections::VecDeque;
use alloc::vec::Vec;

use crate::{Outlet, Stamped, Synchronizer};

/// The policy of making sets from equal stamps.
///
/// ```
/// use pub_sub::{ExactTime, Outlet, Set, Stamped, Synchronizer};
///
/// #[derive(Default)]
/// struct Words(Vec<&'static str>);
/// impl Outlet<&'static str> for Words {
///     fn emitted(&mut self, set: Set<'_, &'static str>) {
///         self.0.extend(set.map(|stamped| stamped.message));
///     }
/// }
///
/// let mut exact = ExactTime::new(2, 10);
/// let at = |stamp_ns, message| Stamped { stamp_ns, message };
/// let mut words = Words::default();
/// exact.arrive(1, at(7, "right"), &mut words);
/// exact.arrive(0, at(7, "left"), &mut words);
/// assert_eq!(words.0, ["left", "right"]);
/// ```
pub struct ExactTime<M> {
    topics: usize,
    /// 0 for no limit.
    queue_size: usize,
    /// In ascending order of the stamp, each stamp once.
    entries: VecDeque<Entry<M>>,
    /// Empty slots for entries to come.
    spare: Vec<Slots<M>>,
    /// The set being emitted; otherwise empty.
    set: Vec<Stamped<M>>,
}

/// A slot for each topic.
type Slots<M> = Vec<Option<M>>;

struct Entry<M> {
    stamp_ns: u64,
    /// At least one slot is full.
    slots: Slots<M>,
}

impl<M> ExactTime<M> {
    /// Makes a synchronizer that keeps at most `queue_size` incomplete sets; 0 is no limit. Between
    /// arrivals it holds at most that many messages of a topic.
    ///
    /// # Panics
    ///
    /// If `topics` is 0, or memory does not suffice for `topics * (queue_size + 1)`
    /// messages.
    pub fn new(topics: usize, queue_size: usize) -> Self {
        assert!(
            topics > 0,
            "a synchronizer needs a topic; give it at least 1"
        );
        let entries = match queue_size {
            0 => 0,
            _ => queue_size.saturating_add(1),
        };
        let mut exact = Self {
            topics,
            queue_size,
            entries: VecDeque::with_capacity(entries),
            spare: Vec::with_capacity(entries),
            set: Vec::with_capacity(topics),
        };
        exact.spare.extend((0..entries).map(|_| empty(topics)));
        exact
    }

    /// Returns the position of a stamp's entry, and makes the entry if there is none.
    fn entry(&mut self, stamp_ns: u64) -> usize {
        let known = self
            .entries
            .binary_search_by_key(&stamp_ns, |entry| entry.stamp_ns);
        known.unwrap_or_else(|position| {
            // Spare slots run out only without a limit: all entries within a limit are reserved.
            let slots = self.spare.pop().unwrap_or_else(|| empty(self.topics));
            let entry = Entry { stamp_ns, slots };
            self.entries.insert(position, entry);
            position
        })
    }

    /// Emits the entry at a position (step 2, first part).
    fn emit(&mut self, position: usize, outlet: &mut dyn Outlet<M>) {
        let Some(mut entry) = self.entries.remove(position) else {
            return;
        };
        let messages = entry.slots.iter_mut().filter_map(Option::take);
        self.set.extend(messages.map(|message| Stamped {
            stamp_ns: entry.stamp_ns,
            message,
        }));
        self.spare.push(entry.slots);
        outlet.emitted(self.set.drain(..));
    }

    /// Drops the entry with the smallest stamp.
    fn drop_smallest(&mut self, outlet: &mut dyn Outlet<M>) {
        let Some(mut entry) = self.entries.pop_front() else {
            return;
        };
        let stamp_ns = entry.stamp_ns;
        for (topic, slot) in entry.slots.iter_mut().enumerate() {
            if let Some(message) = slot.take() {
                outlet.dropped(topic, Stamped { stamp_ns, message });
            }
        }
        self.spare.push(entry.slots);
    }
}

fn empty<M>(topics: usize) -> Slots<M> {
    (0..topics).map(|_| None).collect()
}

impl<M> Synchronizer<M> for ExactTime<M> {
    fn arrive(&mut self, topic: usize, message: Stamped<M>, outlet: &mut dyn Outlet<M>) {
        assert!(
            topic < self.topics,
            "there is no topic {topic}; there are {}, counted from 0",
            self.topics
        );
        let Stamped { stamp_ns, message } = message;
        let position = self.entry(stamp_ns);
        let slots = &mut self.entries[position].slots;
        if let Some(message) = slots[topic].replace(message) {
            outlet.replaced(topic, Stamped { stamp_ns, message });
        }
        if slots.iter().all(Option::is_some) {
            self.emit(position, outlet);
            for _ in 0..position {
                self.drop_smallest(outlet);
            }
        }
        while self.queue_size > 0 && self.entries.len() > self.queue_size {
            self.drop_smallest(outlet);
        }
    }
}
