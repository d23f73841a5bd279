//! The subtasks of all DAGs as the scheduler walks them: joins and phases (R2).
//!
//! Subtasks are numbered over all DAGs, in the order of the commit; the number
//! is a *vertex*. All that the way from a completion to its successors needs of a
//! vertex lies together, in one cache line.
//!
//! Jobs in flight are known by *sequence number*: their position among the released jobs
//! of their DAG, from 0. Skipped jobs have none, so the sequence has no gaps, and
//! the job before the one with number s is the one with number s - 1. A job's
//! *slot* is its sequence number modulo the number of slots of its DAG.
//!
//! Each vertex has a counter for each slot: the predecessors that have not
//! finished yet, and for a source the release. The only one of a DAG of one slot is
//! kept in the vertex itself. Each has its *progress*: the
//! sequence number of the job that it has to do next. An instance (s, v) is
//! ready when its counter is 0 and v's progress is s. Whichever of both comes
//! last makes it ready, exactly once.
//!
//! A counter returns to its initial value when its instance ends, long before
//! the slot's next job is released; so a release touches sources only, and an
//! end touches successors only.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::ops::Range;

use super::jobs::Job;
use crate::ids::{CoreId, DagId, Instance, SubtaskId, to_u32};
use crate::journal::EventKind;
use crate::policy::Preemption;
use crate::table::Table;
use crate::task_set::TaskSet;

/// The phase of a subtask's next instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum InstancePhase {
    /// It is not ready.
    Absent,
    /// It is ready and has not started.
    Ready,
    /// It executes.
    Running(CoreId),
    /// It has started, and is in line for a core: it lost its own, or its wait has ended.
    Preempted,
    /// It has started, and waits for something else than a core.
    Waiting,
}

/// The line that a subtask's instances come into: its group's, which has the number of the group's
/// first core, or the cluster's; or none, if a table has the DAG.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct LineId(pub(super) u16);

impl LineId {
    pub(super) const CLUSTER: Self = Self(u16::MAX);
    pub(super) const TABLE: Self = Self(u16::MAX - 1);

    pub(super) fn new(affinity: &[u32]) -> Self {
        affinity.first().map_or(Self::CLUSTER, |first| {
            Self(u16::try_from(*first).expect("verified to be in range"))
        })
    }

    #[inline]
    pub(super) fn is_cluster(self) -> bool {
        self == Self::CLUSTER
    }

    #[inline]
    pub(super) fn is_table(self) -> bool {
        self == Self::TABLE
    }
}

/// The work at the end of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum EndKind {
    /// Anything.
    Any,
    /// The end is told to its successors and to nobody else: it has some, its job is the only one
    /// in flight, and is not cut.
    PassesOn,
    /// Likewise, in a table.
    PassesOnInTable,
}

/// One subtask, in one cache line.
#[derive(Clone, Copy, Debug, Hash)]
#[repr(align(64))]
pub(super) struct Vertex {
    pub(super) phase: InstancePhase,
    /// The sequence number of the job that it has to do next, or is doing.
    pub(super) progress: u64,
    /// The number of the job that it is doing.
    pub(super) job: u64,
    /// The rank that the [`ReadyQueue`](super::ready_queue::ReadyQueue) gives it, if keys have one.
    pub(super) rank: u32,
    pub(super) dag: DagId,
    pub(super) subtask: SubtaskId,
    /// Whether a started instance may lose its core; a member does so also to a more urgent one.
    pub(super) is_preemptible: bool,
    pub(super) ends: EndKind,
    pub(super) line: LineId,
    /// The initial value of a counter.
    initial: u32,
    /// Its counter, if it has one slot.
    counter: u32,
    /// Where its counters begin if it has several, and the mask of the slots.
    counters: u32,
    slot_mask: u32,
    /// Where its successors begin and end.
    successors: [u32; 2],
}

/// The successors that an end in a job is still to be told to.
#[derive(Clone, Debug)]
pub(super) struct Successors {
    job: u64,
    next: u32,
    end: u32,
}

impl Successors {
    #[inline]
    pub(super) const fn is_empty(&self) -> bool {
        self.next >= self.end
    }
}

const _: () = assert!(size_of::<Vertex>() == 64, "one cache line");

/// All subtasks.
#[derive(Clone, Debug, Hash)]
pub(super) struct VertexTable {
    vertices: Box<[Vertex]>,
    /// The successors of all vertices, those of one together.
    successors: Box<[u32]>,
    /// The counters of all vertices of several slots, those of one together.
    counters: Box<[u32]>,
}

impl VertexTable {
    #[inline]
    pub(super) fn new(task_set: &TaskSet, preemption: Preemption) -> Self {
        let mut all = Self {
            vertices: Box::default(),
            successors: Box::default(),
            counters: Box::default(),
        };
        let mut vertices = Vec::with_capacity(task_set.vertices());
        let (mut successors, mut counters) = (Vec::new(), Vec::new());
        for (id, dag) in (0..).map(DagId).zip(task_set.dags()) {
            let first = task_set.first_vertex(id);
            for (subtask, attributes) in (0..).map(SubtaskId).zip(dag.subtasks()) {
                // A source counts 1, for the release, which arrives as a predecessor would.
                let initial = to_u32(dag.predecessors(subtask).len().max(1));
                let from = to_u32(successors.len());
                successors.extend(dag.successors(subtask).iter().map(|next| first + next.0));
                vertices.push(Vertex {
                    phase: InstancePhase::Absent,
                    progress: 0,
                    job: 0,
                    rank: 0,
                    dag: id,
                    subtask,
                    is_preemptible: preemption == Preemption::Enabled
                        && !attributes.is_non_preemptive(),
                    ends: EndKind::Any,
                    line: LineId::new(dag.affinity()),
                    initial,
                    counter: initial,
                    counters: to_u32(counters.len()),
                    slot_mask: to_u32(dag.slots() - 1),
                    successors: [from, to_u32(successors.len())],
                });
                // One slot is the usual case; its counter lies in the vertex, without a second
                // cache line.
                if dag.slots() > 1 {
                    counters.extend((0..dag.slots()).map(|_| initial));
                }
            }
        }
        all.vertices = vertices.into_boxed_slice();
        all.successors = successors.into_boxed_slice();
        all.counters = counters.into_boxed_slice();
        for entry in task_set.tables().iter().flat_map(Table::entries) {
            let vertex = task_set.first_vertex(entry.dag) + entry.subtask.0;
            all.vertices[vertex as usize].line = LineId::TABLE;
        }
        // No job is cut yet.
        all.allow_passing_on(0..all.vertices.len());
        all
    }

    /// Returns the number of vertices.
    #[inline]
    pub(super) const fn len(&self) -> usize {
        self.vertices.len()
    }

    #[inline]
    pub(super) fn get(&self, vertex: u32) -> &Vertex {
        &self.vertices[vertex as usize]
    }

    #[inline]
    pub(super) fn get_mut(&mut self, vertex: u32) -> &mut Vertex {
        &mut self.vertices[vertex as usize]
    }

    /// Takes note that no job of these vertices' DAG is cut any more.
    #[inline]
    pub(super) fn allow_passing_on(&mut self, vertices: Range<usize>) {
        for vertex in &mut self.vertices[vertices] {
            let [from, to] = vertex.successors;
            // With one slot no next job can wait for this vertex, and only the end of a sink can be
            // the end of the job: with successors, neither has to be looked at.
            vertex.ends = match vertex.slot_mask == 0 && from < to {
                true if vertex.line.is_table() => EndKind::PassesOnInTable,
                true => EndKind::PassesOn,
                false => EndKind::Any,
            };
        }
    }

    /// Ends the instance that a vertex is doing. By that its [`successors`](Self::successors)
    /// in the same job, which are to be told by [`arrive`](Self::arrive), and its own next
    /// instance may be ready.
    #[inline]
    pub(super) fn end_instance(&mut self, vertex: u32) -> Vertex {
        let own = &mut self.vertices[vertex as usize];
        let ended = *own;
        own.phase = InstancePhase::Absent;
        own.progress += 1;
        // Reset now, long before the slot's next job: so a release writes counters of sources only.
        *own.counter(&mut self.counters, ended.progress) = ended.initial;
        ended
    }

    /// Ends the instance of a vertex that [only passes on](EndKind::PassesOn), and tells its
    /// successors up to the first that is ready by that. The others are still to be told.
    #[inline(always)]
    pub(super) fn pass_on(&mut self, vertex: u32) -> (Option<u32>, Successors) {
        let own = &mut self.vertices[vertex as usize];
        let (job, [next, end]) = (own.job, own.successors);
        own.phase = InstancePhase::Absent;
        own.progress += 1;
        own.counter = own.initial;
        let mut successors = Successors { job, next, end };
        (self.next_ready(&mut successors), successors)
    }

    /// Ends the instance of a vertex that [passes on in a table](EndKind::PassesOnInTable), to one
    /// that waits for it alone and takes its core, and returns that instance. `None`: there are no
    /// such two vertices.
    #[inline(always)]
    pub(super) fn hand_over(&mut self, vertex: u32, next: u32, core: CoreId) -> Option<Instance> {
        let pair = [vertex as usize, next as usize];
        let [own, next] = self.vertices.get_disjoint_mut(pair).ok()?;
        own.phase = InstancePhase::Absent;
        own.progress += 1;
        // The counter of the one has been reset, that of the other would be counted down and reset.
        (next.phase, next.job) = (InstancePhase::Running(core), own.job);
        Some(next.present_instance())
    }

    /// Resets the counter of an entry that begins, which its end would do, too.
    #[inline]
    pub(super) fn begin_entry(&mut self, vertex: u32) {
        let own = &mut self.vertices[vertex as usize];
        own.counter = own.initial;
    }

    /// Tells successors, of one slot each, up to the first that is ready by that.
    #[inline(always)]
    pub(super) fn next_ready(&mut self, successors: &mut Successors) -> Option<u32> {
        while successors.next < successors.end {
            let number = self.successors[successors.next as usize];
            successors.next += 1;
            let next = &mut self.vertices[number as usize];
            // The successor's progress need not be asked: with one slot no older job is in flight
            // that it could still have to do.
            next.counter -= 1;
            if next.counter == 0 {
                // The vertex now does this job; its key is made of it.
                next.job = successors.job;
                return Some(number);
            }
        }
        None
    }

    /// Returns where the successors of a vertex stand, for [`successor`](Self::successor).
    #[inline]
    pub(super) fn successors(vertex: &Vertex) -> Range<usize> {
        let [from, to] = vertex.successors;
        from as usize..to as usize
    }

    /// Returns the successor at a place.
    #[inline]
    pub(super) fn successor(&self, place: usize) -> u32 {
        self.successors[place]
    }

    /// Counts one predecessor, or the release, of a vertex's instance in a job,
    /// and returns the vertex if the instance is ready.
    #[inline]
    pub(super) fn arrive(&mut self, vertex: u32, sequence: u64) -> Option<&mut Vertex> {
        let vertex = &mut self.vertices[vertex as usize];
        let counter = vertex.counter(&mut self.counters, sequence);
        *counter -= 1;
        // Both parts of R2: all predecessors in this job, and the subtask's own instance of the
        // job before.
        (*counter == 0 && vertex.progress == sequence).then_some(vertex)
    }

    /// Returns a vertex if its next instance, of a job that is released, waits for
    /// no predecessor.
    #[inline]
    pub(super) fn next_is_ready(&mut self, vertex: u32) -> Option<&mut Vertex> {
        let vertex = &mut self.vertices[vertex as usize];
        (*vertex.counter(&mut self.counters, vertex.progress) == 0).then_some(vertex)
    }
}

impl Vertex {
    /// Has a core begin or continue its instance, and returns which of both.
    #[inline(always)]
    pub(super) fn run(&mut self, core: CoreId) -> EventKind {
        // The phase still tells whether the instance has started.
        let what = match self.phase {
            InstancePhase::Preempted => EventKind::Resume,
            _ => EventKind::Start,
        };
        self.phase = InstancePhase::Running(core);
        what
    }

    /// Returns the vertex's part of a job.
    #[inline]
    pub(super) const fn instance(&self, job: &Job) -> Instance {
        Instance::new(self.dag, job.number, self.subtask)
    }

    /// Returns the instance that it is doing, which is ready or has started.
    #[inline]
    pub(super) const fn present_instance(&self) -> Instance {
        Instance::new(self.dag, self.job, self.subtask)
    }

    /// Returns the counter of a job, which is its own or one of `counters`.
    #[inline]
    fn counter<'a>(&'a mut self, counters: &'a mut [u32], sequence: u64) -> &'a mut u32 {
        if self.slot_mask == 0 {
            return &mut self.counter;
        }
        // The number of slots is a power of two, so that a mask finds the counter.
        let slot = sequence & u64::from(self.slot_mask);
        #[allow(clippy::cast_possible_truncation, reason = "a slot fits into a u32")]
        let place = self.counters as usize + slot as usize;
        &mut counters[place]
    }
}
