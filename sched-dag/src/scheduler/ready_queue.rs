//! The instances waiting for a core, in the order of their keys (R5).
//!
//! # Ranks, or a heap
//!
//! If the policy adds no release, the order of all instances that can ever wait together is mostly
//! known at commit. Then each subtask has a *rank*, and the queue is a set of bits, with the same
//! cost however many wait. Up to 64 subtasks are bits of a single word, at hand without any call.
//! The exception: if two subtasks of one DAG share a number and jobs of that DAG overlap, the job
//! comes before the subtask, and the queue is a heap. If the policy adds the release, the queue is
//! a heap of jobs or, where subtasks of one DAG have different numbers, of instances.
//!
//! # Alone
//!
//! Often a released instance is the only instance in line and starts at once. So an instance
//! entering an empty queue is kept outside of the order: it passes through without being sorted in,
//! and joins the others when a second instance comes.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::bits::BitSet;
use super::heap::IndexedHeap;
use super::job_heap::JobHeap;
use super::jobs::Job;
use super::key::{DispatchKey, KeyOrder};
use super::vertices::{Vertex, VertexTable};
use crate::ids::{DagId, to_u32};
use crate::order::{sorted, sorted_by_key};
use crate::policies::Policy;
use crate::task_set::{Dag, TaskSet};

/// The instances in line. At most one instance of a vertex waits at a time.
#[derive(Clone, Debug, Hash)]
pub(super) struct ReadyQueue {
    /// The number of instances in line.
    count: u32,
    /// The key of the only instance, if it entered an empty queue; otherwise no key.
    alone: DispatchKey,
    order: KeyOrder,
    /// The policy's number of each vertex under `Sum`, otherwise empty.
    numbers_ns: Box<[u64]>,
    line: OrderedLine,
}

/// The ordered part of the line. `repr(u8)`, so that testing for the first variant takes one
/// comparison.
#[derive(Clone, Debug, Hash)]
#[repr(u8)]
enum OrderedLine {
    /// For keys that are ranks up to 63.
    Word {
        ranks: u64,
        /// The vertex of each rank.
        vertices: Box<[u32]>,
    },
    /// For keys that are ranks.
    Ranked {
        ranks: BitSet,
        /// The vertex of each rank.
        vertices: Box<[u32]>,
    },
    /// For keys beginning with a part common to all instances of a job.
    OfJobs(JobHeap),
    /// For any keys, by vertex.
    Keyed(IndexedHeap<DispatchKey>),
}

impl ReadyQueue {
    /// Makes the queue for a set and a policy, and gives vertices their ranks.
    #[inline]
    pub(super) fn new(task_set: &TaskSet, policy: Policy, vertices: &mut VertexTable) -> Self {
        let numbers = task_set.dags().iter().map(|dag| policy.numbers(dag));
        let numbers: Vec<Vec<u64>> = numbers.collect();
        let mut dags = task_set.dags().iter().zip(&numbers);
        let of_vertices = numbers.concat();
        if policy.adds_release() {
            if dags.all(|(_, numbers)| numbers.iter().all(|number| *number == numbers[0])) {
                let jobs = JobHeap::new(task_set);
                return Self::of(KeyOrder::Release, OrderedLine::OfJobs(jobs));
            }
            // Of two jobs of a DAG with the same sum, the older has the larger number.
            let of_dag = |dag: DagId, number: u64| u128::from(dag.0) << 64 | u128::from(!number);
            let keys = (0..).zip(&of_vertices);
            let keys = keys.map(|(vertex, number)| of_dag(vertices.get(vertex).dag, *number));
            rank(&keys.collect::<Vec<_>>(), vertices, KeyOrder::Sum);
            return Self {
                numbers_ns: of_vertices.into(),
                ..Self::of(KeyOrder::Sum, keyed(vertices.len()))
            };
        }
        let keys: Vec<u128> = of_vertices.into_iter().map(u128::from).collect();
        // If all DAGs have ranks, no key needs its job: the whole order is known at the commit.
        if dags.all(|(dag, numbers)| has_ranks(dag, numbers)) {
            let order = rank(&keys, vertices, KeyOrder::Rank);
            return Self::of(KeyOrder::Rank, ranked(&order));
        }
        // The rank represents (number, DAG), so that the job's number can follow it in the key.
        rank(&keys, vertices, KeyOrder::Job);
        Self::of(KeyOrder::Job, keyed(vertices.len()))
    }

    /// Makes a queue for no instances.
    pub(super) fn without_room() -> Self {
        Self::of(KeyOrder::Job, keyed(0))
    }

    #[inline]
    fn of(order: KeyOrder, line: OrderedLine) -> Self {
        Self {
            count: 0,
            alone: DispatchKey::NONE,
            order,
            numbers_ns: Box::default(),
            line,
        }
    }

    /// Returns the key of a vertex's next instance. The closure `job` finds the instance's job.
    #[inline]
    pub(super) fn key<'j>(
        &self,
        number: u32,
        vertex: &Vertex,
        job: impl FnOnce() -> &'j Job,
    ) -> DispatchKey {
        // The usual order is recognized by one comparison, the next by a second.
        if self.order == KeyOrder::Rank {
            return DispatchKey::of_rank(vertex.rank, number);
        }
        let job = job();
        if self.order == KeyOrder::Release {
            return DispatchKey::of_parts(job.sum_ns, job.slot, number);
        }
        self.rare_key(number, vertex, job)
    }

    /// Out of line, so that no other key pays for it.
    #[inline(never)]
    fn rare_key(&self, number: u32, vertex: &Vertex, job: &Job) -> DispatchKey {
        match self.order {
            KeyOrder::Sum => {
                let sum_ns = job.release_ns + self.numbers_ns[number as usize];
                DispatchKey::of_parts(sum_ns, vertex.rank, number)
            }
            _ => DispatchKey::by_job(number, vertex),
        }
    }

    /// Reports whether the queue is empty.
    #[inline]
    pub(super) const fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Returns the smallest key.
    #[inline(always)]
    pub(super) fn peek(&self) -> Option<DispatchKey> {
        if !self.alone.is_none() {
            return Some(self.alone);
        }
        (!self.is_empty()).then(|| self.line.peek())
    }

    /// Puts an instance in line.
    #[inline(always)]
    pub(super) fn insert(&mut self, key: DispatchKey) {
        self.count += 1;
        if self.count == 1 {
            self.alone = key;
            return;
        }
        if !self.alone.is_none() {
            let first = core::mem::replace(&mut self.alone, DispatchKey::NONE);
            self.line.insert(first);
        }
        self.line.insert(key);
    }

    /// Takes the instance with the smallest key out.
    #[inline(always)]
    pub(super) fn pop(&mut self) -> Option<DispatchKey> {
        if self.is_empty() {
            return None;
        }
        self.count -= 1;
        match self.alone.is_none() {
            true => Some(self.line.pop()),
            false => Some(core::mem::replace(&mut self.alone, DispatchKey::NONE)),
        }
    }

    /// Takes a waiting instance out.
    #[inline]
    pub(super) fn remove(&mut self, key: DispatchKey) {
        self.count -= 1;
        match self.alone.is_none() {
            true => self.line.remove(key),
            false => self.alone = DispatchKey::NONE,
        }
    }
}

impl OrderedLine {
    /// Returns the smallest key. The line is not empty.
    #[cold]
    #[inline]
    fn peek(&self) -> DispatchKey {
        let first = match self {
            Self::Word { ranks, vertices } => {
                return of_rank(ranks.trailing_zeros() as usize, vertices);
            }
            Self::Ranked { ranks, vertices } => return of_rank(ranks.first(), vertices),
            Self::OfJobs(jobs) => jobs.peek(),
            Self::Keyed(heap) => heap.peek().map(|(key, _)| key),
        };
        first.expect("as many are in line as were counted")
    }

    #[inline(always)]
    fn insert(&mut self, key: DispatchKey) {
        match self {
            Self::Word { ranks, .. } => *ranks |= 1 << key.rank(),
            _ => self.insert_beyond_a_word(key),
        }
    }

    // `cold` makes this a call, which leaves the caller its registers, but compiled with the
    // caller's optimization.
    #[cold]
    #[inline]
    fn insert_beyond_a_word(&mut self, key: DispatchKey) {
        match self {
            Self::Ranked { ranks, .. } => ranks.insert(key.rank()),
            _ => self.insert_in_heap(key),
        }
    }

    #[cold]
    #[inline]
    fn insert_in_heap(&mut self, key: DispatchKey) {
        match self {
            Self::Word { .. } | Self::Ranked { .. } => {}
            Self::OfJobs(jobs) => jobs.insert(key),
            Self::Keyed(heap) => heap.set(key.vertex() as usize, key),
        }
    }

    /// Takes the instance with the smallest key out. The line is not empty.
    #[inline(always)]
    fn pop(&mut self) -> DispatchKey {
        match self {
            Self::Word { ranks, vertices } => {
                let rank = ranks.trailing_zeros();
                // Clears the lowest set bit, the first in line.
                *ranks &= ranks.wrapping_sub(1);
                DispatchKey::of_rank(rank, vertices[rank as usize])
            }
            _ => self.pop_beyond_a_word(),
        }
    }

    #[cold]
    #[inline]
    fn pop_beyond_a_word(&mut self) -> DispatchKey {
        match self {
            Self::Ranked { ranks, vertices } => of_rank(ranks.pop(), vertices),
            _ => self.pop_from_heap(),
        }
    }

    #[cold]
    #[inline]
    fn pop_from_heap(&mut self) -> DispatchKey {
        let first = match self {
            Self::Word { .. } | Self::Ranked { .. } => None,
            Self::OfJobs(jobs) => jobs.pop(),
            Self::Keyed(heap) => heap.pop().map(|(key, _)| key),
        };
        first.expect("as many are in line as were counted")
    }

    #[inline]
    fn remove(&mut self, key: DispatchKey) {
        match self {
            Self::Word { ranks, .. } => *ranks &= !(1 << key.rank()),
            Self::Ranked { ranks, .. } => ranks.remove(key.rank()),
            Self::OfJobs(jobs) => jobs.remove(key),
            Self::Keyed(heap) => heap.remove(key.vertex() as usize),
        }
    }
}

/// Returns the key of a rank.
#[inline]
fn of_rank(rank: usize, vertices: &[u32]) -> DispatchKey {
    DispatchKey::of_rank(to_u32(rank), vertices[rank])
}

/// Makes the line of vertices in the order of their ranks.
#[inline]
fn ranked(order: &[u32]) -> OrderedLine {
    let vertices = order.into();
    match order.len() {
        // Ranks 0 to 63 are the bits of one word.
        0..=64 => OrderedLine::Word { ranks: 0, vertices },
        count => OrderedLine::Ranked {
            ranks: BitSet::new(count),
            vertices,
        },
    }
}

/// Makes a line for so many vertices with any keys.
fn keyed(vertices: usize) -> OrderedLine {
    OrderedLine::Keyed(IndexedHeap::new(vertices))
}

/// Reports whether the subtasks of a DAG, as far as they wait together, are in the same order
/// whatever jobs they do.
fn has_ranks(dag: &Dag, numbers: &[u64]) -> bool {
    dag.in_flight() == 1 || (sorted(numbers).windows(2)).all(|pair| pair[0] != pair[1])
}

/// Gives each vertex its place in the order of (key, DAG, subtask), or of (key, DAG) if a part of
/// the job comes next. Returns the vertices in that order.
fn rank(keys: &[u128], vertices: &mut VertexTable, kind: KeyOrder) -> Vec<u32> {
    // Vertices count DAG by DAG, within a DAG by subtask, and the sort is stable.
    let order = sorted_by_key(keys.len(), |vertex| keys[vertex]);
    let order: Vec<u32> = order.into_iter().map(to_u32).collect();
    let mut rank = 0;
    let mut last = None;
    for &number in &order {
        let vertex = vertices.get_mut(number);
        // Otherwise equals share a rank, and the job decides between them.
        let group = (keys[number as usize], vertex.dag);
        if last.is_some_and(|last| kind == KeyOrder::Rank || last != group) {
            rank += 1;
        }
        last = Some(group);
        vertex.rank = rank;
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(number: u32) -> DispatchKey {
        DispatchKey::of_parts(u64::from(number) << 32, 0, number)
    }

    /// One of each kind that needs no task set, with room for so many.
    fn queues() -> [(ReadyQueue, u32); 4] {
        let ranked = |count| (ReadyQueue::of(KeyOrder::Rank, ranked(&order(count))), count);
        let keyed = (ReadyQueue::of(KeyOrder::Job, keyed(100)), 100);
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
