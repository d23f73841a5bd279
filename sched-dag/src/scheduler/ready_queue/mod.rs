//! The instances that wait for a core, in the order of their keys (R5).
//!
//! # The front
//!
//! Often an instance that has just become ready is the only one in line and starts
//! at once, on the core that its predecessor has left. So the queue keeps one
//! instance, the *front*, outside of its ordered rest: such an instance passes
//! through without being sorted in. The front, if there is one, has the
//! smallest key of all.
//!
//! # The rest
//!
//! Under static priority the order of all instances that can ever wait together
//! is mostly known at commit: then each subtask has a *rank*, and the rest is a
//! set of bits, which costs the same however many wait; up to 64 subtasks are bits of
//! one word, which is at hand without any call. That holds unless two
//! subtasks of one DAG share a priority and jobs of that DAG overlap, because
//! then the job comes before the subtask. In that case the rest is a heap. Under
//! EDF it is a heap of jobs or, where sinks have deadlines of their own, of instances.

mod ranks;

use alloc::boxed::Box;

use super::bits::BitSet;
use super::by_deadline::ByDeadline;
use super::heap::IndexedHeap;
use super::jobs::Job;
use super::key::{Key, Order};
use super::vertices::{Vertex, Vertices};
use crate::policy::Policy;
use crate::task_set::TaskSet;
use ranks::{deadlines_ns, has_ranks, rank, rank_by_deadline};

/// The instances in line. At most one of a vertex waits at a time.
#[derive(Clone, Debug, Hash)]
pub(super) struct ReadyQueue {
    /// The smallest key, or none.
    front: Key,
    /// How many are in the rest.
    others: u32,
    order: Order,
    /// Under `SinkDeadline` the relative deadline of each rank, else nothing.
    deadlines_ns: Box<[u64]>,
    rest: Rest,
}

/// `repr(u8)`, so that testing for the first variant takes one comparison.
#[derive(Clone, Debug, Hash)]
#[repr(u8)]
enum Rest {
    /// For keys that are ranks up to 63.
    Word {
        ranks: u64,
        /// The vertex of each rank. Keys are made of both, not loaded: loaded by
        /// halves or as one, the front would have to be loaded the same way, and a
        /// processor cannot load as one what it has just stored by halves.
        vertices: Box<[u32]>,
    },
    /// For keys that are ranks.
    Ranked {
        ranks: BitSet,
        /// The key of each rank.
        keys: Box<[Key]>,
    },
    /// For keys that begin with a deadline.
    ByDeadline(ByDeadline),
    /// For any keys, by vertex.
    Keyed(IndexedHeap<Key>),
}

impl ReadyQueue {
    /// Makes the queue for a set and a policy; gives vertices their ranks.
    #[inline]
    pub(super) fn new(task_set: &TaskSet, policy: Policy, vertices: &mut Vertices) -> Self {
        let in_any_order = |count| Rest::Keyed(IndexedHeap::new(count));
        if policy == Policy::Edf {
            if task_set
                .dags()
                .iter()
                .all(|dag| deadlines_ns(dag).len() == 1)
            {
                let rest = Rest::ByDeadline(ByDeadline::new(task_set));
                return Self::of(Order::Deadline, rest);
            }
            return Self {
                deadlines_ns: rank_by_deadline(task_set, vertices).into(),
                ..Self::of(Order::SinkDeadline, in_any_order(vertices.len()))
            };
        }
        if task_set.dags().iter().all(has_ranks) {
            let order = rank(vertices, Order::Rank);
            return Self::of(Order::Rank, ranked(&order));
        }
        rank(vertices, Order::Job);
        Self::of(Order::Job, in_any_order(vertices.len()))
    }

    #[inline]
    fn of(order: Order, rest: Rest) -> Self {
        Self {
            front: Key::NONE,
            others: 0,
            order,
            deadlines_ns: Box::default(),
            rest,
        }
    }

    /// Returns the key of a vertex's next instance, which is of the job that `job` finds.
    #[inline]
    pub(super) fn key<'j>(
        &self,
        number: u32,
        vertex: &Vertex,
        job: impl FnOnce() -> &'j Job,
    ) -> Key {
        // The usual one is told apart by one comparison, and the next one by another.
        if self.order == Order::Rank {
            return Key::of_rank(vertex.rank, number);
        }
        let job = job();
        if self.order == Order::Deadline {
            return Key::of_parts(job.deadline_ns, job.slot, number);
        }
        self.rare_key(number, vertex, job)
    }

    /// Apart, so that no other key pays for it.
    #[inline(never)]
    fn rare_key(&self, number: u32, vertex: &Vertex, job: &Job) -> Key {
        match self.order {
            Order::SinkDeadline => {
                let deadline_ns = self.deadlines_ns[vertex.rank as usize];
                Key::by_sink(deadline_ns, number, vertex, job)
            }
            _ => Key::by_job(number, vertex),
        }
    }

    /// Reports whether none waits.
    #[inline]
    pub(super) const fn is_empty(&self) -> bool {
        self.front.is_none() && self.others == 0
    }

    /// Returns the smallest key.
    #[inline]
    pub(super) fn peek(&self) -> Option<Key> {
        if !self.front.is_none() {
            return Some(self.front);
        }
        if self.others == 0 {
            return None;
        }
        self.rest.peek()
    }

    /// Puts an instance in line.
    #[inline]
    pub(super) fn insert(&mut self, key: Key) {
        if self.is_empty() {
            self.front = key;
        } else {
            self.insert_among_others(key);
        }
    }

    /// Compares with the front only: comparing with the rest costs as much as inserting.
    #[inline]
    fn insert_among_others(&mut self, key: Key) {
        let precedes_front = !self.front.is_none() && key < self.front;
        let behind = match precedes_front {
            true => core::mem::replace(&mut self.front, key),
            false => key,
        };
        self.others += 1;
        self.rest.insert(behind);
    }

    /// Takes the instance with the smallest key out.
    #[inline]
    pub(super) fn pop(&mut self) -> Option<Key> {
        if !self.front.is_none() {
            return Some(core::mem::replace(&mut self.front, Key::NONE));
        }
        if self.others == 0 {
            return None;
        }
        self.others -= 1;
        Some(self.rest.pop())
    }

    /// Takes an instance out, which waits.
    #[inline]
    pub(super) fn remove(&mut self, key: Key) {
        if self.front == key {
            self.front = Key::NONE;
            return;
        }
        self.others -= 1;
        self.rest.remove(key);
    }
}

impl Rest {
    #[inline]
    fn peek(&self) -> Option<Key> {
        match self {
            Self::Word { ranks, vertices } => {
                let rank = ranks.trailing_zeros();
                let vertex = vertices.get(rank as usize)?;
                Some(Key::of_rank(rank, *vertex))
            }
            Self::Ranked { ranks, keys } => ranks.first().map(|rank| keys[rank]),
            Self::ByDeadline(jobs) => jobs.peek(),
            Self::Keyed(heap) => heap.peek().map(|(key, _)| key),
        }
    }

    #[inline]
    fn insert(&mut self, key: Key) {
        match self {
            Self::Word { ranks, .. } => *ranks |= 1 << key.rank(),
            _ => self.insert_beyond_a_word(key),
        }
    }

    // `cold`: a call, which leaves the caller its registers, but compiled as the caller is.
    #[cold]
    #[inline]
    fn insert_beyond_a_word(&mut self, key: Key) {
        match self {
            Self::Word { .. } => {}
            Self::Ranked { ranks, .. } => ranks.insert(key.rank()),
            Self::ByDeadline(jobs) => jobs.insert(key),
            Self::Keyed(heap) => heap.set(key.vertex() as usize, key),
        }
    }

    #[inline]
    fn remove(&mut self, key: Key) {
        match self {
            Self::Word { ranks, .. } => *ranks &= !(1 << key.rank()),
            Self::Ranked { ranks, .. } => ranks.remove(key.rank()),
            Self::ByDeadline(jobs) => jobs.remove(key),
            Self::Keyed(heap) => heap.remove(key.vertex() as usize),
        }
    }

    /// Takes the instance with the smallest key out, of which there is one.
    #[inline]
    fn pop(&mut self) -> Key {
        match self {
            Self::Word { ranks, vertices } => {
                let rank = ranks.trailing_zeros();
                *ranks &= ranks.wrapping_sub(1);
                Key::of_rank(rank, vertices[rank as usize])
            }
            _ => self.pop_beyond_a_word(),
        }
    }

    #[cold]
    #[inline]
    fn pop_beyond_a_word(&mut self) -> Key {
        let first = match self {
            Self::Word { .. } => None,
            Self::Ranked { ranks, keys } => ranks.pop().map(|rank| keys[rank]),
            Self::ByDeadline(jobs) => jobs.pop(),
            Self::Keyed(heap) => heap.pop().map(|(key, _)| key),
        };
        first.expect("as many are in line as were counted")
    }
}

/// Makes the rest for vertices in the order of their ranks.
#[inline]
fn ranked(order: &[u32]) -> Rest {
    let keys = (0u32..).zip(order);
    match order.len() {
        0..=64 => Rest::Word {
            ranks: 0,
            vertices: order.into(),
        },
        count => Rest::Ranked {
            ranks: BitSet::new(count),
            keys: keys
                .map(|(rank, &vertex)| Key::of_rank(rank, vertex))
                .collect(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(number: u32) -> Key {
        Key::of_parts(u64::from(number) << 32, 0, number)
    }

    /// One of each kind that needs no task set, with room for so many.
    fn queues() -> [(ReadyQueue, u32); 4] {
        let ranked = |count| (ReadyQueue::of(Order::Rank, ranked(&order(count))), count);
        let keyed = Rest::Keyed(IndexedHeap::new(100));
        let keyed = (ReadyQueue::of(Order::Job, keyed), 100);
        [ranked(63), ranked(64), ranked(100), keyed]
    }

    fn order(count: u32) -> Vec<u32> {
        (0..count).collect()
    }

    #[test]
    fn pops_ascending_however_inserts_pops_and_removals_mix() {
        for (mut queue, count) in queues() {
            for number in 0..count {
                queue.insert(key((number * 37) % count));
                if number % 3 == 0 {
                    let first = queue.peek();
                    let popped = queue.pop().expect("one waits");
                    assert_eq!(Some(popped), first);
                    queue.insert(popped);
                }
            }
            // The front, too.
            for vertex in (0..count).step_by(4) {
                queue.remove(key(vertex));
            }
            let left = order(count).into_iter().filter(|vertex| vertex % 4 != 0);
            let popped: Vec<_> = core::iter::from_fn(|| queue.pop()).collect();
            assert_eq!(popped.len(), left.count());
            assert!(popped.iter().all(|&popped| popped == key(popped.vertex())));
            assert!(popped.is_sorted());
        }
    }
}
