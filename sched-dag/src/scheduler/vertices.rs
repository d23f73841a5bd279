//! The subtasks of all DAGs in the scheduler's own form: joins and phases (R2).
//!
//! Subtasks are numbered over all DAGs, in the order of the commit; the number is a *vertex*. All
//! data of a vertex needed between a completion and its successors lies together, in a single cache
//! line.
//!
//! Jobs in flight are known by *sequence number*: their position among the released jobs of their
//! DAG, from 0. Skipped jobs have none, so the sequence has no gaps, and the job before number s is
//! number s - 1. A job's *slot* is its sequence number modulo the number of slots of its DAG.
//!
//! Each vertex has a counter for each slot: the number of predecessors still to finish, and for a
//! source the release. A DAG with one slot keeps the single counter in the vertex itself. Each
//! vertex has its *progress*: the sequence number of its next job. An instance (s, v) is ready when
//! its counter is 0 and v's progress is s. The later of the two events makes the instance ready,
//! exactly once.
//!
//! A counter returns to its initial value when its instance ends, long before the slot's next job
//! is released; so a release touches sources only, and an end touches successors only.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::ops::Range;

use super::jobs::Job;
use crate::ids::{CoreId, DagId, Instance, SubtaskId, to_u32};
use crate::journal::EventKind;
use crate::policy::Preemption;
use crate::table::Table;
use crate::task_set::TaskSet;

/// The phase of a subtask's present instance, or of its next one.
///
/// ```text
///         +-------------- 2 ---------------+
///         |                                v
///    +--------+     +-------+         +---------+ --- 6 --> +---------+
///    | Absent | -1> | Ready | -- 3 -> | Running |           | Waiting |
///    +--------+     +-------+         +---------+           +---------+
///     ^ ^ ^ ^           |               |  |  ^               |  ^  |
///     | | | +---- 9 ----+               8  4  5               7  6  9
///     | | |                             |  |  |               |  |  |
///     | | +-----------------------------+  v  |               |  |  |
///     | |                             +-----------+ <---------+  |  |
///     | +-------------- 8 ----------- | Preempted | -------------+  |
///     |                               +-----------+                 |
///     +---------------- 9 ------------------------------------------+
/// ```
///
/// 1. The job is released, and all predecessors and the subtask's instance in the job before have
///    ended (R2). The instance enters the ready queue, or is reported to the list of its core.
/// 2. Likewise, but the core that has just finished takes the instance at once, past the queue
///    (`Scheduler::pass`, [`VertexTable::hand_over`]).
/// 3. A dispatch starts the instance ([`Vertex::run`]).
/// 4. A dispatch gives the core to another instance (`Scheduler::preempt`). Or the instance takes a
///    wait of no time while another instance is first in line.
/// 5. A dispatch resumes the instance ([`Vertex::run`]).
/// 6. The instance begins a wait (W1). From `Preempted`: when a driver reports the end of a turn
///    after the scheduler has decided to preempt.
/// 7. The answer or the limit of the wait has come (W2).
/// 8. The instance finishes or fails.
/// 9. The job is cut: the instance is cancelled ([`EventKind::Cancelled`]).
///
/// A cut cancels no running or preempted instance. An instance that would become ready in a cut job
/// stays `Absent`, and its end is passed on. A waiting instance runs again only by way of
/// `Preempted`, and cannot finish or fail before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum InstancePhase {
    /// Not ready.
    Absent,
    /// Ready, and not started.
    Ready,
    /// Executing on the core.
    Running(CoreId),
    /// Started, and in line for a core: the instance lost its core, or its wait has ended.
    Preempted,
    /// Started, and waiting for something else than a core.
    Waiting,
}

/// The ready queue for a subtask's instances: the queue of its group, numbered by the group's first
/// core, or the cluster's queue; or none, for a DAG in a table.
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

/// The work to do at the end of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum EndKind {
    /// Any work: no shortcut.
    Any,
    /// The end concerns the successors only: the vertex has some, and its job is the only one in
    /// flight and not cut.
    PassesOn,
    /// Likewise, for a vertex in a table.
    PassesOnInTable,
}

/// A subtask, in one cache line.
#[derive(Clone, Copy, Debug, Hash)]
#[repr(align(64))]
pub(super) struct Vertex {
    pub(super) phase: InstancePhase,
    /// The sequence number of the vertex's next or present job.
    pub(super) progress: u64,
    /// The number of the present job.
    pub(super) job: u64,
    /// The rank from the [`ReadyQueue`](super::ready_queue::ReadyQueue), if keys have ranks.
    pub(super) rank: u32,
    pub(super) dag: DagId,
    pub(super) subtask: SubtaskId,
    /// Whether a started instance may lose its core: to an entry of the core's list, and, as a
    /// member of a group, also to a more urgent member.
    pub(super) is_preemptible: bool,
    pub(super) ends: EndKind,
    pub(super) line: LineId,
    /// The initial value of each counter.
    initial: u32,
    /// The counter of a vertex with one slot.
    counter: u32,
    /// The first counter of a vertex with several slots, and the mask of the slots.
    counters: u32,
    slot_mask: u32,
    /// The range of the vertex's successors: begin and end.
    successors: [u32; 2],
}

/// The successors still to be told of an end in a job.
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
    /// The successors of all vertices, grouped by vertex.
    successors: Box<[u32]>,
    /// The counters of all vertices with several slots, grouped by vertex.
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
                // A source counts 1 for the release, which arrives like a predecessor.
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

    /// Notes that the DAG of these vertices has no cut job any more.
    #[inline]
    pub(super) fn allow_passing_on(&mut self, vertices: Range<usize>) {
        for vertex in &mut self.vertices[vertices] {
            let [from, to] = vertex.successors;
            // With one slot no next job can wait for this vertex, and a job ends only with an
            // instance without successors. So the end of any other instance needs neither check.
            vertex.ends = match vertex.slot_mask == 0 && from < to {
                true if vertex.line.is_table() => EndKind::PassesOnInTable,
                true => EndKind::PassesOn,
                false => EndKind::Any,
            };
        }
    }

    /// Ends the vertex's present instance. As a consequence, its [`successors`](Self::successors)
    /// in the same job, to be told by [`arrive`](Self::arrive), and its own next instance may be
    /// ready.
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

    /// Ends the instance of a vertex that [only passes on](EndKind::PassesOn), and tells the
    /// successors up to the first one made ready. The other successors are still to be told.
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

    /// Ends the instance of a vertex that [passes on in a table](EndKind::PassesOnInTable), and
    /// starts the successor `next`, which waits for this vertex alone, on the same core. Returns
    /// the started instance, or `None` if the two vertices are the same or do not exist.
    #[inline(always)]
    pub(super) fn hand_over(&mut self, vertex: u32, next: u32, core: CoreId) -> Option<Instance> {
        let pair = [vertex as usize, next as usize];
        let [own, next] = self.vertices.get_disjoint_mut(pair).ok()?;
        own.phase = InstancePhase::Absent;
        own.progress += 1;
        // Both counters have their initial values already: the ended vertex's was reset when its
        // entry began, or never counted down after a hand-over; the successor's would be counted
        // down to 0 and reset.
        (next.phase, next.job) = (InstancePhase::Running(core), own.job);
        Some(next.present_instance())
    }

    /// Resets the counter of an entry that begins, in advance of the reset at its end.
    #[inline]
    pub(super) fn begin_entry(&mut self, vertex: u32) {
        let own = &mut self.vertices[vertex as usize];
        own.counter = own.initial;
    }

    /// Tells successors, of one slot each, up to the first one made ready.
    #[inline(always)]
    pub(super) fn next_ready(&mut self, successors: &mut Successors) -> Option<u32> {
        while successors.next < successors.end {
            let number = self.successors[successors.next as usize];
            successors.next += 1;
            let next = &mut self.vertices[number as usize];
            // No need to check the successor's progress: with one slot, no older job is in flight
            // that the successor could still have to do.
            next.counter -= 1;
            if next.counter == 0 {
                // The vertex now does this job; its key is made from the job's number.
                next.job = successors.job;
                return Some(number);
            }
        }
        None
    }

    /// Returns the places of a vertex's successors, for [`successor`](Self::successor).
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

    /// Counts one predecessor, or the release, of a vertex's instance in a job. Returns the vertex
    /// if the instance is ready.
    #[inline]
    pub(super) fn arrive(&mut self, vertex: u32, sequence: u64) -> Option<&mut Vertex> {
        let vertex = &mut self.vertices[vertex as usize];
        let counter = vertex.counter(&mut self.counters, sequence);
        *counter -= 1;
        // Both parts of R2: all predecessors in this job, and the subtask's own instance of the job
        // before.
        (*counter == 0 && vertex.progress == sequence).then_some(vertex)
    }

    /// Returns a vertex if its next instance waits for no predecessor. The job of that instance is
    /// released.
    #[inline]
    pub(super) fn next_is_ready(&mut self, vertex: u32) -> Option<&mut Vertex> {
        let vertex = &mut self.vertices[vertex as usize];
        (*vertex.counter(&mut self.counters, vertex.progress) == 0).then_some(vertex)
    }
}

impl Vertex {
    /// Starts or resumes the instance on a core. Returns the matching event kind.
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

    /// Returns the vertex's instance in a job.
    #[inline]
    pub(super) const fn instance(&self, job: &Job) -> Instance {
        Instance::new(self.dag, job.number, self.subtask)
    }

    /// Returns the present instance, which is ready or has started.
    #[inline]
    pub(super) const fn present_instance(&self) -> Instance {
        Instance::new(self.dag, self.job, self.subtask)
    }

    /// Returns the counter of a job: the vertex's own, or an element of `counters`.
    #[inline]
    fn counter<'a>(&'a mut self, counters: &'a mut [u32], sequence: u64) -> &'a mut u32 {
        if self.slot_mask == 0 {
            return &mut self.counter;
        }
        // The number of slots is a power of two, so a mask finds the counter.
        let slot = sequence & u64::from(self.slot_mask);
        #[allow(clippy::cast_possible_truncation, reason = "a slot fits into a u32")]
        let place = self.counters as usize + slot as usize;
        &mut counters[place]
    }
}
