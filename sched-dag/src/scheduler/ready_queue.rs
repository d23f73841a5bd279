//! The instances that wait for a core, in the order of their keys (R5).
//!
//! # The front
//!
//! Often an instance that has just become ready is the first in line and starts
//! at once, on the core that its predecessor has left. So the queue keeps one
//! instance, the *front*, outside of its ordered rest: such an instance passes
//! through without being sorted in. The front, if there is one, has the
//! smallest key of all.
//!
//! # The rest
//!
//! Under static priority the order of all instances that can ever wait together
//! is mostly known at commit: then each subtask has a *rank*, keys begin with
//! it, and the rest is a set of bits, which costs the same however many wait.
//! That holds unless two subtasks of one DAG share a priority and jobs of that
//! DAG overlap, because then the job comes before the subtask. In that case, and
//! under EDF, the rest is a heap.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::bits::BitSet;
use super::heap::IndexedHeap;
use super::key::Key;
use super::vertices::Vertices;
use crate::ids::to_u32;
use crate::order::{sorted, sorted_by_key};
use crate::policy::Policy;
use crate::task_set::{Dag, TaskSet};

/// The instances in line. At most one of a vertex waits at a time.
#[derive(Debug)]
pub(super) struct ReadyQueue {
    front: Key,
    /// The vertex of the front, or [`NOBODY`].
    front_vertex: u32,
    /// How many are in the rest.
    others: u32,
    rest: Rest,
}

/// Stands for a vertex where there is none.
const NOBODY: u32 = u32::MAX;

#[derive(Debug)]
enum Rest {
    /// For keys that begin with a rank.
    Ranked {
        ranks: BitSet,
        /// The key and the vertex of each rank.
        waiting: Box<[(Key, u32)]>,
    },
    /// For any keys, by vertex.
    Keyed(IndexedHeap<Key>),
}

impl ReadyQueue {
    /// Makes the queue for a set and a policy; gives vertices their ranks where
    /// it can.
    pub(super) fn new(task_set: &TaskSet, policy: Policy, vertices: &mut Vertices) -> Self {
        let is_ranked = policy == Policy::StaticPriority && task_set.dags().iter().all(has_ranks);
        let rest = if is_ranked {
            rank(vertices);
            Rest::Ranked {
                ranks: BitSet::new(vertices.len()),
                waiting: vec![(Key::NONE, 0); vertices.len()].into_boxed_slice(),
            }
        } else {
            Rest::Keyed(IndexedHeap::new(vertices.len()))
        };
        Self::of(rest)
    }

    const fn of(rest: Rest) -> Self {
        Self {
            front: Key::NONE,
            front_vertex: NOBODY,
            others: 0,
            rest,
        }
    }

    /// Returns the smallest key.
    #[inline]
    pub(super) fn peek(&self) -> Option<Key> {
        if self.front_vertex != NOBODY {
            return Some(self.front);
        }
        if self.others == 0 {
            return None;
        }
        self.rest.peek()
    }

    /// Puts an instance of a vertex in line.
    #[inline]
    pub(super) fn insert(&mut self, vertex: u32, key: Key) {
        let is_empty = self.front_vertex == NOBODY && self.others == 0;
        if is_empty {
            (self.front, self.front_vertex) = (key, vertex);
        } else {
            self.insert_among_others(vertex, key);
        }
    }

    fn insert_among_others(&mut self, vertex: u32, key: Key) {
        if self.peek().is_some_and(|first| first < key) {
            self.insert_behind(vertex, key);
            return;
        }
        let earlier = (self.front_vertex, self.front);
        (self.front, self.front_vertex) = (key, vertex);
        if earlier.0 != NOBODY {
            self.insert_behind(earlier.0, earlier.1);
        }
    }

    /// Takes the instance with the smallest key out.
    #[inline]
    pub(super) fn pop(&mut self) -> Option<(Key, u32)> {
        if self.front_vertex != NOBODY {
            let vertex = core::mem::replace(&mut self.front_vertex, NOBODY);
            return Some((self.front, vertex));
        }
        if self.others == 0 {
            return None;
        }
        self.others -= 1;
        self.rest.pop()
    }

    /// Takes the instance of a vertex out, which waits.
    pub(super) fn remove(&mut self, vertex: u32, urgency: u64) {
        if self.front_vertex == vertex {
            self.front_vertex = NOBODY;
            return;
        }
        self.others -= 1;
        match &mut self.rest {
            Rest::Ranked { ranks, .. } => ranks.remove(place(urgency)),
            Rest::Keyed(heap) => heap.remove(vertex as usize),
        }
    }

    fn insert_behind(&mut self, vertex: u32, key: Key) {
        self.others += 1;
        self.rest.insert(vertex, key);
    }
}

impl Rest {
    fn peek(&self) -> Option<Key> {
        match self {
            Self::Ranked { ranks, waiting } => ranks.first().map(|rank| waiting[rank].0),
            Self::Keyed(heap) => heap.peek().map(|(key, _)| key),
        }
    }

    fn insert(&mut self, vertex: u32, key: Key) {
        match self {
            Self::Ranked { ranks, waiting } => {
                let rank = place(key.urgency());
                waiting[rank] = (key, vertex);
                ranks.insert(rank);
            }
            Self::Keyed(heap) => heap.set(vertex as usize, key),
        }
    }

    fn pop(&mut self) -> Option<(Key, u32)> {
        match self {
            Self::Ranked { ranks, waiting } => {
                let rank = ranks.first()?;
                ranks.remove(rank);
                Some(waiting[rank])
            }
            Self::Keyed(heap) => heap.pop().map(|(key, vertex)| (key, to_u32(vertex))),
        }
    }
}

/// Reports whether the subtasks of a DAG, as far as they wait together, are in
/// the same order whatever jobs they do.
fn has_ranks(dag: &Dag) -> bool {
    let priorities: Vec<_> = dag.subtasks().iter().map(|s| s.priority().0).collect();
    let priorities = sorted(&priorities);
    dag.in_flight() == 1 || priorities.windows(2).all(|pair| pair[0] != pair[1])
}

/// Replaces each vertex's priority by its place in the order of (priority, DAG,
/// subtask).
fn rank(vertices: &mut Vertices) {
    // Vertices count DAG by DAG, within a DAG by subtask, and the sort is stable.
    let urgency = |vertex| vertices.get(to_u32(vertex)).urgency;
    let order = sorted_by_key(vertices.len(), urgency);
    for (rank, vertex) in (0..).zip(order) {
        vertices.get_mut(to_u32(vertex)).urgency = rank;
    }
}

/// Returns a rank as an index.
fn place(rank: u64) -> usize {
    usize::try_from(rank).expect("there are fewer ranks than vertices in memory")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ids::{DagId, Instance, SubtaskId};

    fn key(urgency: u64) -> Key {
        Key::new(
            urgency,
            Instance {
                dag: DagId(0),
                job: 0,
                subtask: SubtaskId(0),
            },
        )
    }

    fn queues() -> [ReadyQueue; 2] {
        let ranked = Rest::Ranked {
            ranks: BitSet::new(100),
            waiting: vec![(Key::NONE, 0); 100].into_boxed_slice(),
        };
        [ranked, Rest::Keyed(IndexedHeap::new(100))].map(ReadyQueue::of)
    }

    #[test]
    fn pops_ascending_however_inserts_pops_and_removals_mix() {
        for mut queue in queues() {
            for number in 0..100u32 {
                let urgency = (number * 37) % 100;
                queue.insert(urgency, key(u64::from(urgency)));
                if number % 3 == 0 {
                    let first = queue.peek();
                    let (popped, vertex) = queue.pop().expect("one waits");
                    assert_eq!(Some(popped), first);
                    queue.insert(vertex, popped);
                }
            }
            for vertex in (0..100).step_by(4) {
                queue.remove(vertex, u64::from(vertex));
            }
            let popped: Vec<_> = core::iter::from_fn(|| queue.pop()).collect();
            assert_eq!(popped.len(), 75);
            assert!(
                popped
                    .iter()
                    .all(|(key, vertex)| key.urgency() == u64::from(*vertex))
            );
            assert!(popped.is_sorted());
        }
    }

    #[test]
    fn the_front_may_be_removed() {
        for mut queue in queues() {
            queue.insert(7, key(7));
            queue.insert(3, key(3));
            queue.remove(3, 3);
            assert_eq!(queue.pop(), Some((key(7), 7)));
            assert_eq!(queue.pop(), None);
        }
    }
}
