//! Ready instances in the order of their deadlines.
//!
//! All instances of a job have the deadline of the job. So it is jobs that are put
//! in order, by a heap, and each has a set of bits for its subtasks: a job with a
//! hundred ready subtasks is one entry of the heap, not a hundred.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::bits::BitSet;
use super::heap::IndexedHeap;
use super::key::Key;
use crate::ids::{DagId, to_u32};
use crate::task_set::TaskSet;

/// Instances by the absolute deadline, then by the slot of the job, then by vertex.
#[derive(Clone, Debug, Hash)]
pub(super) struct ByDeadline {
    /// What comes before the vertex in the keys of the jobs that have ready instances, by slot.
    jobs: IndexedHeap<u128>,
    /// By slot.
    lines: Box<[Line]>,
}

/// The ready instances of one job in flight.
#[derive(Clone, Debug, Hash)]
struct Line {
    /// The first vertex of its DAG.
    first: u32,
    /// The ready ones, counted from there.
    subtasks: BitSet,
}

impl ByDeadline {
    #[inline]
    pub(super) fn new(task_set: &TaskSet) -> Self {
        let mut lines = Vec::new();
        for (id, dag) in (0..).map(DagId).zip(task_set.dags()) {
            lines.extend((0..dag.slots()).map(|_| Line {
                first: task_set.first_vertex(id),
                subtasks: BitSet::new(dag.subtasks().len()),
            }));
        }
        Self {
            jobs: IndexedHeap::new(lines.len()),
            lines: lines.into_boxed_slice(),
        }
    }

    #[inline]
    pub(super) fn insert(&mut self, key: Key) {
        let slot = key.slot();
        let line = &mut self.lines[slot];
        if line.subtasks.is_empty() {
            self.jobs.set(slot, key.before_the_vertex());
        }
        line.subtasks.insert((key.vertex() - line.first) as usize);
    }

    /// Returns the smallest key.
    #[inline]
    pub(super) fn peek(&self) -> Option<Key> {
        let (job, slot) = self.jobs.peek()?;
        let line = &self.lines[slot];
        let vertex = line.first + to_u32(line.subtasks.first()?);
        Some(Key::of_job(job, vertex))
    }

    /// Takes the instance with the smallest key out.
    #[inline]
    pub(super) fn pop(&mut self) -> Option<Key> {
        let (job, slot) = self.jobs.peek()?;
        let line = &mut self.lines[slot];
        let vertex = line.first + to_u32(line.subtasks.pop()?);
        if line.subtasks.is_empty() {
            self.jobs.remove(slot);
        }
        Some(Key::of_job(job, vertex))
    }

    #[inline]
    pub(super) fn remove(&mut self, key: Key) {
        let slot = key.slot();
        let line = &mut self.lines[slot];
        line.subtasks.remove((key.vertex() - line.first) as usize);
        if line.subtasks.is_empty() {
            self.jobs.remove(slot);
        }
    }
}
