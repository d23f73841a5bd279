//! Groups: the lines of DAGs with an affinity, next to the cluster's line and the tables' cores.
//!
//! A DAG may state an *affinity*, some cores of its cluster. Such cores form a *group*; groups do
//! not overlap. If no DAG states an affinity, all cores of the cluster are the only group. A DAG
//! without a table is a *member* of its group, and its instances enter the group's line (T4 of
//! [`table`](crate::table)).
//!
//! # A dispatch with several lines
//!
//! The cores in tables come first ([`lists`](super::lists)). Then, group by group, idle cores take
//! the first instance in the group's line. If no core is idle, the least urgent instance on the
//! group's cores gives way to the first in line, unless the running instance is an entry, keeps its
//! core or has the smaller key. So each core is still named in a single exchange: a group takes no
//! core from an entry, nor from another group. The cluster's line belongs to the only group, and
//! comes last. Afterwards a group with a non-empty line has no idle core.
//!
//! # The short ways
//!
//! A core that has finished an instance goes on with its list, or else takes the first instance in
//! its group's line. Only that core is concerned, unless another core is touched, the single
//! instance made ready is in a line of other cores, or this core's list had to wait for the end.

use alloc::boxed::Box;
use alloc::vec;

use super::Scheduler;
use super::jobs::Job;
use super::key::DispatchKey;
use super::lists::ListTable;
use super::ready_queue::ReadyQueue;
use super::vertices::{LineId, Vertex, VertexTable};
use crate::ids::{ClusterId, CoreId, DagId};
use crate::policies::SchedulerOptions;
use crate::task_set::{Dag, TaskSet};

/// The line of the cluster, the lines of its groups, and the lists of its cores.
#[derive(Clone, Debug, Hash)]
pub(super) struct ReadyLines {
    cluster: ReadyQueue,
    /// By the number of a [`LineId`]; empty if no DAG states an affinity.
    apart: Box<[GroupLine]>,
    /// By core, the line of its group.
    groups: Box<[LineId]>,
    pub(super) lists: ListTable,
    /// Whether all instances enter the cluster's line.
    is_one: bool,
    /// The number of instances in lines of groups.
    count: u32,
    /// The line most recently entered by an instance.
    latest: LineId,
}

/// The line of a group with stated cores.
#[derive(Clone, Debug, Hash)]
struct GroupLine {
    ready: ReadyQueue,
    cores: Box<[CoreId]>,
}

impl ReadyLines {
    /// Makes the lines of a cluster and gives vertices their ranks.
    #[inline]
    pub(super) fn new(
        task_set: &TaskSet,
        options: &SchedulerOptions,
        cluster: ClusterId,
        vertices: &mut VertexTable,
    ) -> Self {
        let lists = ListTable::new(task_set, cluster, options.cores);
        let mut lines = Self {
            cluster: ReadyQueue::new(task_set, options.policy, vertices),
            apart: Box::default(),
            groups: Box::default(),
            is_one: lists.is_empty(),
            lists,
            count: 0,
            latest: LineId::CLUSTER,
        };
        let mut members = members(task_set, cluster, vertices);
        if members.any(|dag| !dag.affinity().is_empty()) {
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
        // One line for each core, because lines are numbered by cores; unneeded lines get no room.
        let mut groups = vec![LineId::CLUSTER; cores as usize];
        for dag in members(task_set, cluster, vertices) {
            let line = LineId::new(dag.affinity());
            (dag.affinity().iter()).for_each(|core| groups[*core as usize] = line);
        }
        self.groups = groups.into();
        let lines = (0..).map(LineId).take(cores as usize);
        let apart = lines.map(|line| GroupLine {
            // A copy with room for all vertices: ranks count over the whole cluster.
            ready: match self.groups.contains(&line) {
                true => self.cluster.clone(),
                false => ReadyQueue::without_room(),
            },
            cores: (0..cores)
                .map(CoreId)
                .filter(|core| self.is_for(line, *core))
                .collect(),
        });
        self.apart = apart.collect();
        self.is_one = false;
    }

    /// Reports whether a core executes the instances of a line other than the cluster's.
    #[inline]
    fn is_for(&self, line: LineId, core: CoreId) -> bool {
        self.groups[core.index()] == line
    }

    /// Returns the key of a vertex's next instance. The closure `job` finds the instance's job.
    #[inline]
    pub(super) fn key<'j>(
        &self,
        number: u32,
        vertex: &Vertex,
        job: impl FnOnce() -> &'j Job,
    ) -> DispatchKey {
        self.cluster.key(number, vertex, job)
    }

    /// Puts an instance in line, or reports it to the list of its core.
    #[inline]
    pub(super) fn insert(&mut self, vertex: &Vertex, key: DispatchKey) {
        match self.is_one {
            true => self.cluster.insert(key),
            false => self.insert_apart(vertex, key),
        }
    }

    /// Not inlined, as most sets have a single line.
    #[inline(never)]
    fn insert_apart(&mut self, vertex: &Vertex, key: DispatchKey) {
        self.latest = vertex.line;
        if vertex.line.is_table() {
            self.lists.make_ready(key.vertex(), vertex.job);
        } else if vertex.line.is_cluster() {
            self.cluster.insert(key);
        } else {
            self.count += 1;
            self.apart[vertex.line.0 as usize].ready.insert(key);
        }
    }

    /// Takes out an instance that is in line, or that has begun on its list.
    #[inline]
    pub(super) fn remove(&mut self, vertex: &Vertex, key: DispatchKey) {
        if vertex.line.is_cluster() {
            self.cluster.remove(key);
        } else if vertex.line.is_table() {
            self.lists.end_of(key.vertex(), vertex.job);
        } else {
            self.count -= 1;
            self.apart[vertex.line.0 as usize].ready.remove(key);
        }
    }

    /// Reports whether the cluster's line is empty.
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

    /// Reports whether any instance is in the line of a group with stated cores.
    #[inline]
    const fn has_any_apart(&self) -> bool {
        self.count > 0
    }

    /// Returns the smallest key in a line other than the cluster's.
    #[inline]
    pub(super) fn peek_in(&self, line: LineId) -> Option<DispatchKey> {
        match self.has_any_apart() {
            true => self.peek_apart(line),
            false => None,
        }
    }

    /// Not inlined, as most sets have no such line.
    #[inline(never)]
    fn peek_apart(&self, line: LineId) -> Option<DispatchKey> {
        self.apart[line.0 as usize].ready.peek()
    }

    /// Takes the instance with the smallest key out of a line other than the cluster's.
    #[inline]
    fn pop_in(&mut self, line: LineId) -> Option<DispatchKey> {
        let key = self.apart[line.0 as usize].ready.pop()?;
        self.count -= 1;
        Some(key)
    }

    /// Takes out the next instance for a core that has no instance, and no entry to execute.
    #[inline]
    pub(super) fn pop_for(&mut self, core: CoreId) -> Option<DispatchKey> {
        if self.has_any_apart()
            && let Some(key) = self.pop_apart(core)
        {
            return Some(key);
        }
        // Empty for the cores of groups: a DAG without an affinity would share cores with them,
        // which the commit refuses.
        self.cluster.pop()
    }

    #[inline(never)]
    fn pop_apart(&mut self, core: CoreId) -> Option<DispatchKey> {
        let group = self.groups[core.index()];
        match group.is_cluster() {
            true => None,
            false => self.pop_in(group),
        }
    }

    /// Reports whether all instances enter the cluster's line.
    #[inline]
    pub(super) const fn is_one_line(&self) -> bool {
        self.is_one
    }

    /// Reports whether the cluster's line is the only line, and empty: then the single instance
    /// made ready comes next on a core that has finished its own.
    #[inline]
    pub(super) fn is_one_empty_line(&self) -> bool {
        self.is_empty() && self.is_one
    }

    /// Reports whether an instance, the only one made ready and in the given line, comes next on a
    /// core that has finished its own, without concerning another core.
    #[inline]
    pub(super) fn is_next(&self, line: impl FnOnce() -> LineId, core: CoreId) -> bool {
        match self.is_one {
            true => self.is_empty(),
            false => self.is_next_apart(line(), core),
        }
    }

    #[inline(never)]
    fn is_next_apart(&self, line: LineId, core: CoreId) -> bool {
        match line.is_cluster() {
            true => self.is_empty(),
            false => self.is_for(line, core) && self.peek_in(line).is_none(),
        }
    }

    /// Reports whether the `count` > 0 instances that entered lines last may concern a core other
    /// than this one. `kept` tells whether the instance just finished here was one that keeps its
    /// core.
    #[inline]
    pub(super) fn concern_others(
        &mut self,
        count: u32,
        core: CoreId,
        kept: impl FnOnce() -> bool,
    ) -> bool {
        match self.is_one {
            true => count > 1,
            false => self.concern_others_apart(count, core, kept()),
        }
    }

    #[inline(never)]
    fn concern_others_apart(&mut self, count: u32, core: CoreId, kept: bool) -> bool {
        let line = self.latest;
        // An instance of a table concerns only the core of its entry, touched if it may start.
        if line.is_table() {
            return self.lists.touches_others(core);
        }
        let is_elsewhere = !line.is_cluster() && !self.is_for(line, core);
        // An instance that kept its core kept entries off it, too. Now the list may go on, and
        // displace a member to another core.
        count > 1 || is_elsewhere || kept && self.lists.has(core)
    }
}

/// Returns a cluster's DAGs without a table.
fn members<'a>(
    task_set: &'a TaskSet,
    cluster: ClusterId,
    vertices: &VertexTable,
) -> impl Iterator<Item = &'a Dag> {
    let dags = (0..).map(DagId).zip(task_set.dags());
    let own = dags.filter(move |(_, dag)| dag.cluster() == cluster);
    let line = |id: DagId| vertices.get(task_set.first_vertex(id)).line;
    own.filter_map(move |(id, dag)| (!line(id).is_table()).then_some(dag))
}

impl Scheduler {
    /// Gives cores to everything that precedes the cluster's line or is separate from it: to the
    /// entries of lists, and then to the groups with stated cores.
    #[inline]
    pub(super) fn decide_apart(&mut self) {
        if !self.ready.is_one {
            self.give_apart();
        }
    }

    #[inline(never)]
    fn give_apart(&mut self) {
        // Entries precede all lines (T1), and the members displaced by them are in line for the
        // groups.
        self.decide_lists();
        for line in (0..).map(LineId).take(self.ready.apart.len()) {
            // Each exchange brings in a larger key than the one before and takes out a smaller one.
            while let Some(ready) = self.ready.peek_in(line)
                && let Some(core) = self.take_for(line, ready)
                && let Some(key) = self.ready.pop_in(line)
            {
                let decision = self.give(core, key);
                self.decisions.push(decision);
            }
        }
    }

    /// Takes a core for the first in a line: an idle core, or a core whose instance has to leave.
    fn take_for(&mut self, line: LineId, ready: DispatchKey) -> Option<CoreId> {
        let cores = &*self.ready.apart[line.0 as usize].cores;
        if let Some(idle) = self.cores.take_idle_of(cores) {
            return Some(idle);
        }
        let (core, running) = self.cores.largest_preemptible_of(cores)?;
        if running < ready {
            return None;
        }
        self.preempt(core, running);
        Some(core)
    }
}
