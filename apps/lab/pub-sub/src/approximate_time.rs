//! Close stamps make a set.
//!
//! Each topic has a [ring](TopicRing) of messages in order of arrival. A *search* walks through the
//! rings by advancing cursors, always the cursor of the earliest head. The fronts of all rings may
//! be a *candidate*: the best set found so far, from its earliest to its latest stamp. The *pivot*
//! is the topic with the latest stamp in the first candidate: once the search passes the pivot's
//! message, all sets containing that message have been seen, so the candidate is emitted. A set is
//! better than the candidate if it ends only a little later (the age penalty tells how little) and
//! starts later by more. The numbered steps go on from the last step of
//! [`ExactTime`](crate::ExactTime):
//!
//! 5.  Without a candidate all cursors are at the front.
//! 6.  An arrival is appended, then searched, and only then overflows: the search sees one entry
//!     more than the queue size.
//! 7.  An overflow rewinds all cursors and drops the front of the topic's ring, which is lossy from
//!     then on. If there was a candidate, the synchronizer forgets the candidate, and the search
//!     starts again.
//! 8.  A pass of the search compares the heads. Of equal stamps the lowest topic is the earliest,
//!     the highest the latest.
//! 9.  In every pass all topics but the latest cease to be lossy.
//! 10. Without a candidate: if the heads are further apart than the longest interval, or the latest
//!     topic is lossy, the earliest head is dropped. Otherwise the heads become the candidate. Only
//!     here the interval counts.
//! 11. With a candidate: if the heads are better, all passed entries are dropped, so the heads
//!     become the candidate. The pivot stays.
//! 12. In both cases the earliest head is passed.
//! 13. If that was the pivot's head, or if any later set would be worse, the candidate is emitted.
//! 14. If a topic has no head then, the search goes on *virtually*: the topic's next message counts
//!     with its earliest possible stamp. The result may prove the candidate best. Otherwise the
//!     search waits for the next arrival.
//! 15. Emitting takes the fronts of all rings and rewinds all cursors: passed entries can be in
//!     later sets. The search goes on, so an arrival can emit several sets.
//!
//! So a set usually waits for a message that comes after it, a candidate lives on across arrivals,
//! and every topic's messages are used in order of arrival, each at most once. Such are the
//! properties of the original, not to be mended.
//!
//! Storage for the queue size plus one messages a topic is reserved at construction. A pass costs
//! O(topics). Between two sets there is at most one pass for each held message, because each pass
//! passes or drops a message, and then at most as many virtual passes; an arrival emits at most the
//! queue size plus one sets. Typically an arrival takes a few passes.

use alloc::collections::VecDeque;
use alloc::vec;
use alloc::vec::Vec;
use core::num::NonZeroUsize;

use crate::{Outlet, Stamped, Synchronizer};

/// The parameters of [`ApproximateTime`].
///
/// ```
/// use core::num::NonZeroUsize;
/// use pub_sub::Parameters;
///
/// let queue_size = NonZeroUsize::new(10).expect("not 0");
/// let mut parameters = Parameters::new(3, queue_size);
/// parameters.max_interval_ns = Some(30_000_000);
/// parameters.lower_bounds_ns[0] = 25_000_000;
/// ```
#[derive(Clone, Debug)]
pub struct Parameters {
    /// The most messages of a topic held between arrivals.
    pub queue_size: NonZeroUsize,
    /// The longest distance between the earliest and the latest stamp of a first candidate,
    /// inclusive; `None` for no limit. Later candidates are not tested, because they are better.
    pub max_interval_ns: Option<u64>,
    /// The amount by which a later set must be better.
    pub age_penalty: AgePenalty,
    /// The least distance between two successive stamps of each topic, so that a set may be proved
    /// best without waiting for the next message. The synchronizer believes the bounds: a broken
    /// promise changes the emitted sets.
    pub lower_bounds_ns: Vec<u64>,
}

impl Parameters {
    /// Starts with the defaults: no longest interval, an age penalty of 0.1, lower
    /// bounds of 0.
    ///
    /// # Panics
    ///
    /// If `topics` is 0.
    pub fn new(topics: usize, queue_size: NonZeroUsize) -> Self {
        assert!(
            topics > 0,
            "a synchronizer needs a topic; give it at least 1"
        );
        Self {
            queue_size,
            max_interval_ns: None,
            age_penalty: AgePenalty::default(),
            lower_bounds_ns: vec![0; topics],
        }
    }
}

/// The preference for an older set over a newer set: a factor on the time by which the newer set
/// ends later. The factor is normally 1 or more; a smaller factor prefers newer sets.
///
/// The original multiplies by a floating-point 1 + p and rounds toward zero. Here the factor is the
/// exact value of such a number, M / 2^K, and the product is exact too. A floating-point product
/// would be wrong at ties.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AgePenalty {
    /// M, from 1 to [`MOST_FACTOR`](Self::MOST_FACTOR).
    factor: i64,
    /// K, up to [`MOST_SHIFT`](Self::MOST_SHIFT).
    shift: u32,
}

impl AgePenalty {
    /// The largest M. Differences of stamps have at most 65 bits, so the product stays below 2^127.
    pub const MOST_FACTOR: u64 = (1 << 62) - 1;

    /// The largest K.
    pub const MOST_SHIFT: u32 = 127;

    /// Returns the penalty with the factor 1 + p = `factor / 2^shift`, or `None` if either is out
    /// of range: M from 1 to [`MOST_FACTOR`](Self::MOST_FACTOR), K from 0 to
    /// [`MOST_SHIFT`](Self::MOST_SHIFT).
    ///
    /// ```
    /// use pub_sub::AgePenalty;
    /// assert!(AgePenalty::from_factor(3, 1).is_some(), "1 + 0.5");
    /// assert!(AgePenalty::from_factor(0, 1).is_none());
    /// ```
    pub const fn from_factor(factor: u64, shift: u32) -> Option<Self> {
        if factor == 0 || factor > Self::MOST_FACTOR || shift > Self::MOST_SHIFT {
            return None;
        }
        let factor = factor.cast_signed();
        Some(Self { factor, shift })
    }

    /// Multiplies a difference by the factor, rounded toward zero.
    fn scaled(self, difference_ns: i128) -> i128 {
        let magnitude = (difference_ns.abs() * i128::from(self.factor)) >> self.shift;
        magnitude * difference_ns.signum()
    }
}

/// 0.1: the factor is the double nearest to 1.1.
impl Default for AgePenalty {
    fn default() -> Self {
        Self {
            factor: 2_476_979_795_053_773,
            shift: 51,
        }
    }
}

/// The policy of making sets from stamps close to each other.
pub struct ApproximateTime<M> {
    parameters: Parameters,
    rings: Vec<TopicRing<M>>,
    candidate: Option<Candidate>,
    /// The cursors at the start of a virtual search.
    cursors: Vec<usize>,
    /// The set being emitted; otherwise empty.
    set: Vec<Stamped<M>>,
}

/// The search's memory of its candidate. The candidate itself needs no place, being the fronts of
/// all rings.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    earliest_ns: i128,
    latest_ns: i128,
    /// The topic with the latest stamp in the first candidate.
    pivot: usize,
    pivot_ns: i128,
}

/// The ends of a set of stamps, and their topics.
///
/// Stamps are compared as `i128`: differences of stamps, and stamps moved on by a lower bound, do
/// not fit 64 bits.
#[derive(Clone, Copy, Debug)]
struct StampEnds {
    earliest_ns: i128,
    earliest: usize,
    latest_ns: i128,
    latest: usize,
}

impl StampEnds {
    /// Finds the ends of stamps in the order of their topics (step 8).
    fn of(stamps_ns: impl Iterator<Item = i128>) -> Option<Self> {
        let mut stamps_ns = stamps_ns.enumerate();
        let (_, first_ns) = stamps_ns.next()?;
        let mut ends = Self {
            earliest_ns: first_ns,
            earliest: 0,
            latest_ns: first_ns,
            latest: 0,
        };
        for (topic, stamp_ns) in stamps_ns {
            if stamp_ns < ends.earliest_ns {
                (ends.earliest_ns, ends.earliest) = (stamp_ns, topic);
            }
            if stamp_ns >= ends.latest_ns {
                (ends.latest_ns, ends.latest) = (stamp_ns, topic);
            }
        }
        Some(ends)
    }
}

impl<M> ApproximateTime<M> {
    /// Makes a synchronizer for as many topics as the parameters have.
    ///
    /// # Panics
    ///
    /// If memory does not suffice for the queue size plus one messages a topic.
    pub fn new(parameters: Parameters) -> Self {
        let topics = parameters.lower_bounds_ns.len();
        let entries = parameters.queue_size.get().saturating_add(1);
        Self {
            parameters,
            rings: (0..topics)
                .map(|_| TopicRing::with_capacity(entries))
                .collect(),
            candidate: None,
            cursors: vec![0; topics],
            set: Vec::with_capacity(topics),
        }
    }

    /// Searches until a topic has no waiting entry (steps 8 to 15).
    fn search(&mut self, outlet: &mut dyn Outlet<M>) {
        while let Some(heads) = self.heads() {
            for (topic, ring) in self.rings.iter_mut().enumerate() {
                ring.lossy &= topic == heads.latest;
            }
            let candidate = match self.candidate {
                None if self.is_hopeless(heads) => {
                    let head = self.rings[heads.earliest].take_front();
                    if let Some(head) = head {
                        outlet.dropped(heads.earliest, head);
                    }
                    continue;
                }
                None => Candidate {
                    earliest_ns: heads.earliest_ns,
                    latest_ns: heads.latest_ns,
                    pivot: heads.latest,
                    pivot_ns: heads.latest_ns,
                },
                Some(candidate) if self.is_better(heads, candidate) => {
                    self.drop_passed(outlet);
                    Candidate {
                        earliest_ns: heads.earliest_ns,
                        latest_ns: heads.latest_ns,
                        ..candidate
                    }
                }
                Some(candidate) => candidate,
            };
            self.candidate = Some(candidate);
            self.rings[heads.earliest].advance();
            if heads.earliest == candidate.pivot
                || self.rules_out_later_sets(heads.latest_ns, candidate)
                || (self.heads().is_none() && self.virtual_search(candidate))
            {
                self.emit(outlet);
            }
        }
    }

    /// Returns the ends of the heads, or `None` if a topic has no waiting entry.
    fn heads(&self) -> Option<StampEnds> {
        if self.rings.iter().any(|ring| ring.head_ns().is_none()) {
            return None;
        }
        StampEnds::of(self.rings.iter().filter_map(TopicRing::head_ns))
    }

    /// Returns whether the heads cannot be a first candidate (step 10).
    fn is_hopeless(&self, heads: StampEnds) -> bool {
        let interval_ns = heads.latest_ns - heads.earliest_ns;
        let longest_ns = self.parameters.max_interval_ns;
        longest_ns.is_some_and(|longest_ns| interval_ns > longest_ns.into())
            || self.rings[heads.latest].lossy
    }

    /// Returns whether the heads are better than the candidate (step 11). At a tie they are not.
    fn is_better(&self, heads: StampEnds, candidate: Candidate) -> bool {
        let ends_later_ns = heads.latest_ns - candidate.latest_ns;
        let starts_later_ns = heads.earliest_ns - candidate.earliest_ns;
        self.parameters.age_penalty.scaled(ends_later_ns) < starts_later_ns
    }

    /// Returns whether no set ending at `latest_ns` or later can be better than the candidate (step
    /// 13): as long as the pivot is not passed, such a set would have to start no later than the
    /// pivot.
    fn rules_out_later_sets(&self, latest_ns: i128, candidate: Candidate) -> bool {
        let ends_later_ns = latest_ns - candidate.latest_ns;
        self.parameters.age_penalty.scaled(ends_later_ns)
            >= candidate.pivot_ns - candidate.earliest_ns
    }

    /// Continues the search with the earliest possible future messages, and returns whether the
    /// continuation proves the candidate best (step 14). If not, the cursors are back in their old
    /// places.
    fn virtual_search(&mut self, candidate: Candidate) -> bool {
        for (cursor, ring) in self.cursors.iter_mut().zip(&self.rings) {
            *cursor = ring.cursor;
        }
        while let Some(heads) = self.virtual_heads(candidate) {
            if self.rules_out_later_sets(heads.latest_ns, candidate) {
                return true;
            }
            if self.is_better(heads, candidate) {
                break;
            }
            // The earliest head is no virtual head: a virtual head would not be before the pivot,
            // and then one of the two tests above would have held.
            self.rings[heads.earliest].advance();
        }
        for (&cursor, ring) in self.cursors.iter().zip(&mut self.rings) {
            ring.cursor = cursor;
        }
        false
    }

    /// Returns the ends of the heads; a topic without a head counts with the earliest possible
    /// stamp of its next message.
    fn virtual_heads(&self, candidate: Candidate) -> Option<StampEnds> {
        let lower_bounds_ns = &self.parameters.lower_bounds_ns;
        let stamps_ns = self.rings.iter().zip(lower_bounds_ns);
        StampEnds::of(stamps_ns.map(|(ring, &lower_bound_ns)| {
            ring.head_ns().unwrap_or_else(|| {
                let bound_ns = ring
                    .last_passed_ns()
                    .map(|passed_ns| passed_ns + i128::from(lower_bound_ns));
                bound_ns.map_or(candidate.pivot_ns, |ns| ns.max(candidate.pivot_ns))
            })
        }))
    }

    /// Drops all passed entries, so that the heads become the fronts (step 11).
    fn drop_passed(&mut self, outlet: &mut dyn Outlet<M>) {
        for (topic, ring) in self.rings.iter_mut().enumerate() {
            while let Some(passed) = ring.take_passed() {
                outlet.dropped(topic, passed);
            }
        }
    }

    /// Emits the candidate (step 15).
    fn emit(&mut self, outlet: &mut dyn Outlet<M>) {
        self.candidate = None;
        for ring in &mut self.rings {
            ring.cursor = 0;
            self.set.extend(ring.take_front());
        }
        outlet.emitted(self.set.drain(..));
    }

    /// Makes room in a topic's ring (step 7).
    fn overflow(&mut self, topic: usize, outlet: &mut dyn Outlet<M>) {
        for ring in &mut self.rings {
            ring.cursor = 0;
        }
        let ring = &mut self.rings[topic];
        ring.lossy = true;
        if let Some(front) = ring.take_front() {
            outlet.dropped(topic, front);
        }
        if self.candidate.take().is_some() {
            self.search(outlet);
        }
    }
}

impl<M> Synchronizer<M> for ApproximateTime<M> {
    fn arrive(&mut self, topic: usize, message: Stamped<M>, outlet: &mut dyn Outlet<M>) {
        let topics = self.rings.len();
        assert!(
            topic < topics,
            "there is no topic {topic}; there are {topics}, counted from 0"
        );
        self.rings[topic].entries.push_back(message);
        self.search(outlet);
        if self.rings[topic].entries.len() > self.parameters.queue_size.get() {
            self.overflow(topic, outlet);
        }
    }
}

/// The messages of one topic, oldest arrival first, and the progress of a search. A *cursor*
/// divides them: messages before it are *passed*, messages from it on are *waiting*. The first
/// waiting message is the *head*. Entries leave at the front.
struct TopicRing<M> {
    entries: VecDeque<Stamped<M>>,
    cursor: usize,
    /// Whether an entry was discarded for want of room, and the discarded entry could still have
    /// hidden a better set.
    lossy: bool,
}

impl<M> TopicRing<M> {
    /// Makes an empty ring with room for `entries` entries.
    fn with_capacity(entries: usize) -> Self {
        Self {
            entries: VecDeque::with_capacity(entries),
            cursor: 0,
            lossy: false,
        }
    }

    /// Returns the stamp of the first waiting entry.
    fn head_ns(&self) -> Option<i128> {
        Some(self.entries.get(self.cursor)?.stamp_ns.into())
    }

    /// Returns the stamp of the last passed entry.
    fn last_passed_ns(&self) -> Option<i128> {
        let position = self.cursor.checked_sub(1)?;
        Some(self.entries.get(position)?.stamp_ns.into())
    }

    /// Makes the head passed. Nothing leaves.
    fn advance(&mut self) {
        debug_assert!(self.cursor < self.entries.len(), "no head to advance over");
        self.cursor += 1;
    }

    /// Removes the front entry, while the cursor is at the front.
    fn take_front(&mut self) -> Option<Stamped<M>> {
        debug_assert!(self.cursor == 0, "the front may be passed: rewind first");
        self.entries.pop_front()
    }

    /// Removes the first passed entry.
    fn take_passed(&mut self) -> Option<Stamped<M>> {
        self.cursor = self.cursor.checked_sub(1)?;
        self.entries.pop_front()
    }
}

#[cfg(test)]
mod tests {
    use super::AgePenalty;

    #[test]
    fn products_are_exact_and_round_toward_zero() {
        let half = AgePenalty::from_factor(3, 1).unwrap();
        assert_eq!((half.scaled(3), half.scaled(-3)), (4, -4));
        let tenth = AgePenalty::default();
        assert_eq!((tenth.scaled(10), tenth.scaled(-10)), (11, -11));
        assert_eq!(tenth.scaled(0), 0);
    }

    #[test]
    fn the_default_is_the_double_1_1() {
        let factor = AgePenalty::default().factor as f64 / 2f64.powi(51);
        assert_eq!(factor, 1.0 + 0.1);
    }

    #[test]
    fn the_largest_product_fits() {
        let most = AgePenalty::from_factor(AgePenalty::MOST_FACTOR, 0).unwrap();
        let difference_ns = i128::from(u64::MAX) * 2;
        assert!(most.scaled(difference_ns) > 0);
        assert!(most.scaled(-difference_ns) < 0);
        assert_eq!(AgePenalty::from_factor(1 << 62, 0), None);
        assert_eq!(AgePenalty::from_factor(1, 128), None);
    }
}
