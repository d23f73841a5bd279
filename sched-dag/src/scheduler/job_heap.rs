//! A heap of jobs, each with the set of its ready subtasks.
//!
//! Where all instances of a job have the same sum, as under EDF with one deadline, the heap orders
//! jobs, and each job has a set of bits for its subtasks: a job with a hundred ready subtasks is
//! one entry of the heap, not a hundred.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::bits::BitSet;
use super::heap::IndexedHeap;
use super::key::DispatchKey;
use crate::ids::{DagId, to_u32};
use crate::task_set::TaskSet;

/// Instances by the part common to their job, then by the slot of the job, then by vertex.
#[derive(Clone, Debug, Hash)]
pub(super) struct JobHeap {
    /// By slot, the part before the vertex in the keys of each job with ready instances.
    jobs: IndexedHeap<u128>,
    /// The ready instances by slot.
    lines: Box<[JobQueue]>,
}

/// The ready instances of one job in flight.
#[derive(Clone, Debug, Hash)]
struct JobQueue {
    /// The first vertex of its DAG.
    first: u32,
    /// The ready subtasks, counted from `first`.
    subtasks: BitSet,
}

impl JobHeap {
    #[inline]
    pub(super) fn new(task_set: &TaskSet) -> Self {
        let mut lines = Vec::new();
        for (id, dag) in (0..).map(DagId).zip(task_set.dags()) {
            lines.extend((0..dag.slots()).map(|_| JobQueue {
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
    pub(super) fn insert(&mut self, key: DispatchKey) {
        let slot = key.slot();
        let line = &mut self.lines[slot];
        // The job's first ready instance brings the job into the heap; the others cost a bit each.
        if line.subtasks.is_empty() {
            self.jobs.set(slot, key.before_the_vertex());
        }
        line.subtasks.insert((key.vertex() - line.first) as usize);
    }

    /// Returns the smallest key.
    #[inline]
    pub(super) fn peek(&self) -> Option<DispatchKey> {
        let (job, slot) = self.jobs.peek()?;
        let line = &self.lines[slot];
        let vertex = line.first + to_u32(line.subtasks.first());
        Some(DispatchKey::of_job(job, vertex))
    }

    /// Takes the instance with the smallest key out.
    #[inline]
    pub(super) fn pop(&mut self) -> Option<DispatchKey> {
        let (job, slot) = self.jobs.peek()?;
        let line = &mut self.lines[slot];
        let vertex = line.first + to_u32(line.subtasks.pop());
        // With its last ready instance the job leaves the heap: `peek` relies on no line being
        // empty.
        if line.subtasks.is_empty() {
            self.jobs.remove(slot);
        }
        Some(DispatchKey::of_job(job, vertex))
    }

    #[inline]
    pub(super) fn remove(&mut self, key: DispatchKey) {
        let slot = key.slot();
        let line = &mut self.lines[slot];
        line.subtasks.remove((key.vertex() - line.first) as usize);
        if line.subtasks.is_empty() {
            self.jobs.remove(slot);
        }
    }
}
