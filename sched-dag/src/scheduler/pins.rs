//! Pinned subtasks, and DAGs with an affinity: lines of cores and of groups, next to the cluster's.
//!
//! A subtask may be *pinned* to one core of its cluster. A DAG may state an *affinity*, some cores of
//! its cluster for all of it that is not pinned; such cores are a *group*, and no core is in two. If
//! no DAG states one, all cores of the cluster are the only group. An instance that is not pinned is
//! *of* its DAG's group, and in line there. The rules, whose scenarios in `tests/scenarios/pins.txt`
//! bear their numbers, say what R5 comes to then:
//!
//! - **P1, one core, one group.** No other core executes an instance of a pinned subtask, and none
//!   outside of its group another one.
//! - **P2, pinned first.** On its core a pinned instance goes before all that are not pinned,
//!   whatever their keys; among those pinned to one core the smallest key goes first.
//! - **P3, the others.** The cores of a group for which no pinned instance is eligible execute those
//!   of the group's instances with the smallest keys, on any of these cores. One that has to go for a
//!   pinned one takes the core of the least urgent of its group, if its own key is smaller, or an
//!   idle one. What a group leaves idle no other one takes.
//! - **P4, what keeps its core.** An instance that keeps its core keeps it also from pinned ones, and
//!   the others of its group share the cores that are left.
//!
//! # A dispatch with several lines
//!
//! First each core takes the first in its own line, if it is idle, or if what it runs may be
//! preempted and is not pinned or has a larger key. What it gives up goes back in line. Then, group
//! by group, idle cores take the first in the group's line; when there is none, the least urgent
//! instance on its cores gives way to it, unless that is pinned, keeps its core or has the smaller
//! key. So a core is named in one exchange still: a group takes no core from a pinned instance, nor
//! from another group. The cluster's line is that of the only group, and comes last.
//!
//! Such a dispatch is settled in this sense, too: a core whose own line is not empty runs what keeps
//! it, or a pinned instance with a smaller key; and a group whose line is not empty has no idle core.
//!
//! # The short ways
//!
//! A core that has finished an instance takes the first in its own line, or else in its group's. Only
//! that core is concerned, unless the one instance that has become ready is in a line of other cores,
//! or is not pinned and this core goes on with a pinned one.

use alloc::boxed::Box;
use alloc::vec;

use super::Scheduler;
use super::jobs::Job;
use super::key::DispatchKey;
use super::ready_queue::ReadyQueue;
use super::vertices::{LineId, Vertex, VertexTable};
use crate::ids::{ClusterId, CoreId, DagId};
use crate::policies::SchedulerOptions;
use crate::task_set::{Dag, TaskSet};

/// The line of the cluster, and those of its cores and groups.
#[derive(Clone, Debug, Hash)]
pub(super) struct ReadyLines {
    cluster: ReadyQueue,
    /// By the number of a [`LineId`]; none if all instances come into the cluster's line.
    apart: Box<[CoresLine]>,
    /// By core, the line of its group.
    groups: Box<[LineId]>,
    /// How many are in lines of cores and groups.
    count: u32,
    /// The line that an instance has come into last.
    latest: LineId,
}

/// The line of one core, or of a group that states its cores.
#[derive(Clone, Debug, Hash)]
struct CoresLine {
    ready: ReadyQueue,
    cores: Box<[CoreId]>,
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
            apart: Box::default(),
            groups: Box::default(),
            count: 0,
            latest: LineId::CLUSTER,
        };
        let is_apart = |(_, vertex)| !vertices.get(vertex).line.is_cluster();
        if own_vertices(task_set, cluster).any(is_apart) {
            lines.make_apart(task_set, options.cores, cluster, vertices);
        }
        lines
    }

    #[cold]
    #[inline(never)]
    fn make_apart(
        &mut self,
        task_set: &TaskSet,
        cores: u32,
        cluster: ClusterId,
        vertices: &VertexTable,
    ) {
        // Two for each core, as lines are numbered; those that are not needed have no room.
        let mut is_used = vec![false; 2 * cores as usize];
        let mut groups = vec![LineId::CLUSTER; cores as usize];
        for (dag, vertex) in own_vertices(task_set, cluster) {
            let line = vertices.get(vertex).line;
            if line.is_cluster() {
                continue;
            }
            is_used[line.0 as usize] = true;
            if line.core().is_none() {
                (dag.affinity().iter()).for_each(|core| groups[*core as usize] = line);
            }
        }
        self.groups = groups.into();
        let lines = (0..).map(LineId).zip(is_used);
        let apart = lines.map(|(line, is_used)| CoresLine {
            ready: match is_used {
                true => self.cluster.clone(),
                false => ReadyQueue::without_room(),
            },
            cores: (0..cores)
                .map(CoreId)
                .filter(|core| self.is_for(line, *core))
                .collect(),
        });
        self.apart = apart.collect();
    }

    /// Reports whether a core executes what is in a line, which is not the cluster's.
    #[inline]
    fn is_for(&self, line: LineId, core: CoreId) -> bool {
        line == LineId::of_core(core) || self.groups[core.index()] == line
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
    pub(super) fn insert(&mut self, line: LineId, key: DispatchKey) {
        match self.apart.is_empty() {
            true => self.cluster.insert(key),
            false => self.insert_in(line, key),
        }
    }

    /// Not a part of its callers, as most sets have one line.
    #[inline(never)]
    fn insert_in(&mut self, line: LineId, key: DispatchKey) {
        self.latest = line;
        match self.apart.get_mut(line.0 as usize) {
            Some(apart) => {
                self.count += 1;
                apart.ready.insert(key);
            }
            None => self.cluster.insert(key),
        }
    }

    /// Takes an instance out, which waits.
    #[inline]
    pub(super) fn remove(&mut self, line: LineId, key: DispatchKey) {
        if line.is_cluster() {
            self.cluster.remove(key);
        } else {
            self.count -= 1;
            self.apart[line.0 as usize].ready.remove(key);
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

    /// Reports whether any is in the line of a core or of a group that states its cores.
    #[inline]
    const fn has_any_apart(&self) -> bool {
        self.count > 0
    }

    /// Returns the smallest key in a line that is not the cluster's.
    #[inline]
    pub(super) fn peek_in(&self, line: LineId) -> Option<DispatchKey> {
        match self.has_any_apart() {
            true => self.peek_apart(line),
            false => None,
        }
    }

    /// Not a part of its callers, as most sets have no such line.
    #[inline(never)]
    fn peek_apart(&self, line: LineId) -> Option<DispatchKey> {
        self.apart[line.0 as usize].ready.peek()
    }

    /// Takes the instance with the smallest key out of a line that is not the cluster's.
    #[inline]
    fn pop_in(&mut self, line: LineId) -> Option<DispatchKey> {
        let key = self.apart[line.0 as usize].ready.pop()?;
        self.count -= 1;
        Some(key)
    }

    /// Returns the smallest key in the line of a core.
    #[inline]
    pub(super) fn peek_own(&self, core: CoreId) -> Option<DispatchKey> {
        match self.has_any_apart() {
            true => self.peek_in(LineId::of_core(core)),
            false => None,
        }
    }

    /// Takes out what a core without an instance executes next: the first in its own line, or else
    /// in its group's.
    #[inline]
    pub(super) fn pop_for(&mut self, core: CoreId) -> Option<DispatchKey> {
        if self.has_any_apart()
            && let Some(key) = self.pop_apart(core)
        {
            return Some(key);
        }
        self.cluster.pop()
    }

    #[inline(never)]
    fn pop_apart(&mut self, core: CoreId) -> Option<DispatchKey> {
        let own = self.pop_in(LineId::of_core(core));
        let group = self.groups[core.index()];
        own.or_else(|| match group.is_cluster() {
            true => None,
            false => self.pop_in(group),
        })
    }

    /// Reports whether the cluster's line is the only one, and empty: then the one instance that has
    /// become ready comes next on a core that has finished its own.
    #[inline]
    pub(super) fn is_one_empty_line(&self) -> bool {
        self.is_empty() && self.apart.is_empty()
    }

    /// Reports whether an instance, the only one that has become ready and of the line that is asked
    /// for, comes next on a core that has finished its own, and concerns no other one.
    #[inline]
    pub(super) fn is_next(&self, line: impl FnOnce() -> LineId, core: CoreId) -> bool {
        match self.apart.is_empty() {
            true => self.is_empty(),
            false => self.is_next_apart(line(), core),
        }
    }

    #[inline(never)]
    fn is_next_apart(&self, line: LineId, core: CoreId) -> bool {
        let is_first_in_line = match line.is_cluster() {
            true => self.is_empty(),
            false => self.is_for(line, core) && self.peek_in(line).is_none(),
        };
        is_first_in_line && self.peek_own(core).is_none()
    }

    /// Reports whether the instance that has come in line last, the only new one, may concern
    /// another core than this one, which has finished its own.
    #[inline]
    pub(super) fn latest_concerns_others(&self, core: CoreId) -> bool {
        !self.apart.is_empty() && self.latest_apart_concerns_others(core)
    }

    #[inline(never)]
    fn latest_apart_concerns_others(&self, core: CoreId) -> bool {
        let line = self.latest;
        let is_elsewhere = !line.is_cluster() && !self.is_for(line, core);
        is_elsewhere || line.core().is_none() && self.peek_own(core).is_some()
    }
}

/// Returns the vertices of a cluster's DAGs.
fn own_vertices(task_set: &TaskSet, cluster: ClusterId) -> impl Iterator<Item = (&Dag, u32)> {
    let dags = (0..).map(DagId).zip(task_set.dags());
    let own = dags.filter(move |(_, dag)| dag.cluster() == cluster);
    own.flat_map(|(id, dag)| {
        let vertices = (task_set.first_vertex(id)..).take(dag.subtasks().len());
        vertices.map(move |vertex| (dag, vertex))
    })
}

impl Scheduler {
    /// Gives cores what comes before all in the cluster's line, or has no part in that: what is
    /// pinned (P2), and then what is of a group that states its cores (P3).
    #[inline]
    pub(super) fn decide_apart(&mut self) {
        if self.ready.has_any_apart() {
            self.give_apart();
        }
    }

    #[inline(never)]
    fn give_apart(&mut self) {
        let lines = || (0..).take(self.ready.apart.len()).map(LineId);
        let (of_cores, of_groups) = (lines().step_by(2), lines().skip(1).step_by(2));
        for line in of_cores.chain(of_groups) {
            // Each exchange brings in a larger key than the one before and takes out a smaller one,
            // or one that is not pinned from the one core that the line is of.
            while let Some(ready) = self.ready.peek_in(line)
                && let Some(core) = self.take_for(line, ready)
                && let Some(key) = self.ready.pop_in(line)
            {
                let decision = self.give(core, key);
                self.decisions.push(decision);
            }
        }
    }

    /// Takes a core for the first in a line: an idle one, or one that something has to leave for it.
    fn take_for(&mut self, line: LineId, ready: DispatchKey) -> Option<CoreId> {
        let cores = &*self.ready.apart[line.0 as usize].cores;
        if let Some(idle) = self.cores.take_idle_of(cores) {
            return Some(idle);
        }
        let (core, running) = match line.core() {
            Some(core) => (core, self.cores.running(core)?),
            None => self.cores.largest_preemptible_of(cores)?,
        };
        let vertex = self.vertices.get(running.vertex());
        let is_lent = line.core().is_some() && vertex.line != line;
        if !vertex.is_preemptible || !(is_lent || ready < running) {
            return None;
        }
        self.preempt(core, running);
        Some(core)
    }
}
