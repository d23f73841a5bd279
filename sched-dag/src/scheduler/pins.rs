//! Pinned subtasks: a line for each core, next to the line of the cluster.
//!
//! A subtask may be *pinned* to one core of its cluster. Its instances are in that core's own line,
//! all others in the cluster's. The rules, whose scenarios in `tests/scenarios/pins.txt` bear their
//! numbers, say what R5 comes to then:
//!
//! - **P1, one core.** No other core executes an instance of a pinned subtask.
//! - **P2, pinned first.** On its core a pinned instance goes before all that are not pinned,
//!   whatever their keys; among those pinned to one core the smallest key goes first.
//! - **P3, the others.** The cores for which no pinned instance is eligible execute the instances
//!   with the smallest keys among those that are not pinned, on any of these cores. One that has to
//!   go for a pinned one takes the core of the least urgent, if its own key is smaller, or an idle one.
//! - **P4, what keeps its core.** An instance that keeps its core keeps it also from pinned ones, and
//!   the others share the cores that are left.
//!
//! # A dispatch with pinned instances
//!
//! Each core first takes the first in its own line, if it is idle, or if what it runs may be
//! preempted and is not pinned or has a larger key. What it gives up goes back in line. Then idle
//! cores and the cluster's line come, as without pins; a pinned instance gives way to nothing in
//! that. So a core is named in one exchange still: the cluster's line takes no core from a pinned one.
//!
//! Such a dispatch is settled in this sense, too: a core whose own line is not empty runs what keeps
//! it, or a pinned instance with a smaller key.
//!
//! # The short ways
//!
//! A core that has finished an instance takes the first in its own line, or else in the cluster's.
//! Only that core is concerned, unless the one instance that has become ready is pinned to another
//! one, or is not pinned and this core goes on with a pinned one. A chain that is pinned to one core
//! is handed on as others are, and also past what waits in the cluster's line.

use alloc::boxed::Box;
use alloc::vec;

use super::Scheduler;
use super::jobs::Job;
use super::key::DispatchKey;
use super::ready_queue::{IndexedHeap, ReadyQueue};
use super::vertices::{Pin, Vertex, VertexTable};
use crate::ids::{ClusterId, CoreId, DagId, to_u32};
use crate::policy::SchedulerOptions;
use crate::spec::PINS;
use crate::task_set::TaskSet;

/// The line of the cluster, and those of its cores.
#[derive(Clone, Debug, Hash)]
pub(super) struct ReadyLines {
    cluster: ReadyQueue,
    /// By core; none if nothing is pinned.
    own: Box<[IndexedHeap<DispatchKey>]>,
    /// By vertex: where it is among those that are pinned to its core.
    places: Box<[u32]>,
    /// How many are in lines of cores.
    pinned: u32,
    /// The core of the one that has come in line last.
    latest: Option<CoreId>,
}

impl ReadyLines {
    /// Makes the lines of a cluster; gives vertices their ranks.
    #[inline]
    pub(super) fn new(
        task_set: &TaskSet,
        options: &SchedulerOptions,
        cluster: ClusterId,
        vertices: &mut VertexTable,
    ) -> Self {
        let mut lines = Self {
            cluster: ReadyQueue::new(task_set, options.policy, vertices),
            own: Box::default(),
            places: Box::default(),
            pinned: 0,
            latest: None,
        };
        let is_pinned = |vertex| vertices.get(vertex).pin.core().is_some();
        if PINS && own_vertices(task_set, cluster).any(is_pinned) {
            lines.make_own(task_set, options.cores, cluster, vertices);
        }
        lines
    }

    #[cold]
    #[inline(never)]
    fn make_own(
        &mut self,
        task_set: &TaskSet,
        cores: u32,
        cluster: ClusterId,
        vertices: &VertexTable,
    ) {
        let mut counts = vec![0; cores as usize];
        let mut places = vec![0; vertices.len()];
        for vertex in own_vertices(task_set, cluster) {
            if let Some(core) = vertices.get(vertex).pin.core() {
                places[vertex as usize] = to_u32(counts[core.index()]);
                counts[core.index()] += 1;
            }
        }
        self.own = counts.into_iter().map(IndexedHeap::new).collect();
        self.places = places.into();
    }

    /// Returns the key of a vertex's next instance, which is of the job that `job` finds.
    #[inline]
    pub(super) fn key<'j>(
        &self,
        number: u32,
        vertex: &Vertex,
        job: impl FnOnce() -> &'j Job,
    ) -> DispatchKey {
        self.cluster.key(number, vertex, job)
    }

    /// Puts an instance in line.
    #[inline]
    pub(super) fn insert(&mut self, pin: Pin, key: DispatchKey) {
        let core = pin.core();
        if PINS {
            self.latest = core;
        }
        match core {
            None => self.cluster.insert(key),
            Some(core) => {
                self.pinned += 1;
                self.own[core.index()].set(self.places[key.vertex() as usize] as usize, key);
            }
        }
    }

    /// Takes an instance out, which waits.
    #[inline]
    pub(super) fn remove(&mut self, pin: Pin, key: DispatchKey) {
        match pin.core() {
            None => self.cluster.remove(key),
            Some(core) => {
                self.pinned -= 1;
                self.own[core.index()].remove(self.places[key.vertex() as usize] as usize);
            }
        }
    }

    /// Reports whether none is in the cluster's line.
    #[inline]
    pub(super) const fn is_empty(&self) -> bool {
        self.cluster.is_empty()
    }

    /// Returns the smallest key in the cluster's line.
    #[inline]
    pub(super) fn peek(&self) -> Option<DispatchKey> {
        self.cluster.peek()
    }

    /// Takes the instance with the smallest key out of the cluster's line.
    #[inline]
    pub(super) fn pop(&mut self) -> Option<DispatchKey> {
        self.cluster.pop()
    }

    /// Reports whether any is in the line of a core.
    #[inline]
    const fn has_pinned(&self) -> bool {
        PINS && self.pinned > 0
    }

    /// Returns the smallest key in the line of a core.
    #[inline]
    pub(super) fn peek_own(&self, core: CoreId) -> Option<DispatchKey> {
        match self.has_pinned() {
            true => self.own[core.index()].peek().map(|(key, _)| key),
            false => None,
        }
    }

    /// Takes out what a core without an instance executes next: the first in its own line, or else
    /// in the cluster's.
    #[inline]
    pub(super) fn pop_for(&mut self, core: CoreId) -> Option<DispatchKey> {
        if self.has_pinned()
            && let Some((key, _)) = self.own[core.index()].pop()
        {
            self.pinned -= 1;
            return Some(key);
        }
        self.cluster.pop()
    }

    /// Reports whether an instance, the only one that has become ready, comes next on a core that
    /// has finished its own, and concerns no other one.
    #[inline]
    pub(super) fn is_next(&self, pin: Pin, core: CoreId) -> bool {
        let is_of_the_line = match pin.core() {
            None => self.is_empty(),
            Some(pinned) => pinned == core,
        };
        is_of_the_line && self.peek_own(core).is_none()
    }

    /// Reports whether the instance that has come in line last, the only new one, may concern
    /// another core than this one, which has finished its own.
    #[inline]
    pub(super) fn latest_concerns_others(&self, core: CoreId) -> bool {
        PINS && match self.latest {
            None => self.peek_own(core).is_some(),
            Some(pinned) => pinned != core,
        }
    }
}

/// Returns the vertices of a cluster's DAGs.
fn own_vertices(task_set: &TaskSet, cluster: ClusterId) -> impl Iterator<Item = u32> {
    let dags = (0..).map(DagId).zip(task_set.dags());
    let own = dags.filter(move |(_, dag)| dag.cluster() == cluster);
    own.flat_map(|(id, dag)| (task_set.first_vertex(id)..).take(dag.subtasks().len()))
}

impl Scheduler {
    /// Gives each core the first in its own line, if that goes before what it runs (P2).
    #[inline]
    pub(super) fn decide_pinned(&mut self) {
        if self.ready.has_pinned() {
            self.give_pinned();
        }
    }

    #[inline(never)]
    fn give_pinned(&mut self) {
        for core in (0..).map(CoreId).take(self.cores.count()) {
            let Some(ready) = self.ready.peek_own(core) else {
                continue;
            };
            match self.cores.running(core) {
                None => {
                    self.cores.prefer(core);
                    let _ = self.cores.take_idle();
                }
                Some(running) => {
                    let vertex = self.vertices.get(running.vertex());
                    let goes_first = vertex.pin.core().is_none() || ready < running;
                    if !vertex.is_preemptible || !goes_first {
                        continue;
                    }
                    self.preempt(core, running);
                }
            }
            if let Some(key) = self.ready.pop_for(core) {
                let decision = self.give(core, key);
                self.decisions.push(decision);
            }
        }
    }
}
