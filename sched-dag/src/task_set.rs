//! The verified model: all properties that stay true for as long as the scheduler runs.
//!
//! Only the verification makes a [`TaskSet`], so its holder may rely on acyclic graphs, non-zero
//! periods and deadlines, and indices in range.
//!
//! # How many instances of a DAG can be suspended at once: each keeps a stack
//!
//! Only a started, preemptible instance is ever suspended, and a subtask has at most one started
//! and unfinished instance at a time (R2). No two such instances of the same job precede one
//! another, so their number is at most the width of the graph. The width is at most the number of
//! chains into which the graph can be cut (R. P. Dilworth, Annals of Mathematics 51, 1950). Chains
//! are found greedily, in a single pass that need not find the fewest.
//!
//! An aborted job, or a job cut by a survived fault, makes room for the next job while its
//! instances go on; then the number of jobs in flight is no limit.

use alloc::boxed::Box;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use crate::graph::Graph;
use crate::ids::{ClusterId, DagId, Instance, SubtaskId, Vertex, to_u32};
use crate::policy::AssignmentReason;
use crate::policy::{Activation, OnFault, OverrunPolicy, Priority};
use crate::spec::{LockUse, Wait};
use crate::table::Table;
use crate::topic::Topic;
use crate::wcets::WcetSource;

/// All DAG tasks of one commit; by default none.
#[derive(Clone, Debug, Default)]
pub struct TaskSet {
    pub(crate) dags: Box<[Dag]>,
    /// The number of cores of each cluster; empty if cores are not divided.
    clusters: Box<[u32]>,
    /// Each DAG's first vertex.
    first_vertices: Box<[u32]>,
    /// The number of vertices.
    vertices: usize,
    tables: Box<[Table]>,
    certificate: Option<Box<str>>,
}

/// A verified DAG task.
#[derive(Clone, Debug)]
pub struct Dag {
    pub(crate) name: String,
    pub(crate) graph_hash: u64,
    pub(crate) activation: Activation,
    pub(crate) period_ns: u64,
    pub(crate) relative_deadline_ns: u64,
    pub(crate) offset_ns: u64,
    pub(crate) in_flight: u32,
    pub(crate) overrun: OverrunPolicy,
    pub(crate) on_fault: OnFault,
    pub(crate) cluster: Option<ClusterId>,
    pub(crate) affinity: Box<[u32]>,
    pub(crate) why_there: Option<AssignmentReason>,
    pub(crate) first_job: u64,
    pub(crate) jobs: Option<u64>,
    pub(crate) subtasks: Box<[Subtask]>,
    /// Its sinks include subtasks with a stated deadline.
    pub(crate) graph: Graph,
    pub(crate) state_precedences: Box<[StatePrecedence]>,
    pub(crate) topics: Box<[Topic]>,
    pub(crate) locks: Box<[LockUse]>,
}

/// An edge between two subtasks because they share a state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StatePrecedence {
    /// The state's name.
    pub state: String,
    /// The subtask using the state first in each job.
    pub earlier: SubtaskId,
    /// The subtask waiting for `earlier`.
    pub later: SubtaskId,
}

/// A verified subtask.
#[derive(Clone, Debug)]
pub struct Subtask {
    pub(crate) name: String,
    pub(crate) wcet_ns: Option<u64>,
    pub(crate) waits: Box<[Wait]>,
    pub(crate) wcet_source: WcetSource,
    pub(crate) budget_ns: Option<u64>,
    pub(crate) stack_bytes: Option<u64>,
    pub(crate) priority: Priority,
    pub(crate) non_preemptive: bool,
    pub(crate) relative_deadline_ns: u64,
    /// The longest total wait of an instance to enter all its sections.
    pub(crate) lock_wait_ns: u64,
}

impl TaskSet {
    /// Makes a DAG lose no job to an overrun, for a replay: due releases queue, whatever overrun
    /// policy the DAG has stated. The DAG has only the given jobs, as in its recording, up to its
    /// stated limit; earlier jobs are not released.
    pub fn replay(&mut self, dag: DagId, jobs: Range<u64>) {
        let dag = &mut self.dags[dag.index()];
        dag.overrun = OverrunPolicy::Queue;
        dag.first_job = jobs.start;
        dag.jobs = Some(dag.jobs.map_or(jobs.end, |stated| stated.min(jobs.end)));
    }

    /// Makes a task set of verified DAGs, and counts their subtasks.
    pub(crate) fn new(dags: Box<[Dag]>, clusters: &[u32]) -> Self {
        let mut vertices = 0;
        let firsts = dags.iter().map(|dag| {
            let first = to_u32(vertices);
            vertices += dag.subtasks.len();
            first
        });
        Self {
            first_vertices: firsts.collect(),
            vertices,
            dags,
            clusters: clusters.into(),
            tables: Box::default(),
            certificate: None,
        }
    }

    /// Has these tables enforced. They cover whole DAGs and are in the cores' range.
    #[doc(hidden)]
    pub fn set_tables(&mut self, tables: Vec<Table>) {
        self.tables = tables.into();
    }

    /// Fixes the set: no DAG is paused, resumed or ended from outside, and no mode is entered. The
    /// text is a certificate for the set's analysis, made by `certify` in the analysis.
    pub fn fix(&mut self, certificate: &str) {
        self.certificate = Some(certificate.into());
    }

    /// Returns the certificate of a fixed set.
    pub fn certificate(&self) -> Option<&str> {
        self.certificate.as_deref()
    }

    /// Returns the tables.
    pub fn tables(&self) -> &[Table] {
        &self.tables
    }

    /// Returns the table of a DAG. A DAG is in at most one table.
    pub fn table_of(&self, dag: DagId) -> Option<&Table> {
        let mut tables = self.tables.iter();
        tables.find(|table| table.entries().any(|entry| entry.dag == dag))
    }

    /// Returns the number of jobs of a DAG in one lap of its table.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    pub fn jobs_in_lap(&self, table: &Table, dag: DagId) -> u64 {
        table.lap_ns / self.dag(dag).period_ns()
    }

    /// Returns the DAGs in the order of the commit.
    pub fn dags(&self) -> &[Dag] {
        &self.dags
    }

    /// Returns a DAG.
    ///
    /// # Panics
    ///
    /// If `dag` is not of this task set.
    pub fn dag(&self, dag: DagId) -> &Dag {
        &self.dags[dag.index()]
    }

    /// Returns the number of subtasks of all DAGs, which equals the number of vertices.
    pub const fn vertices(&self) -> usize {
        self.vertices
    }

    /// Returns the vertex of an instance's subtask.
    ///
    /// # Panics
    ///
    /// If there is no such DAG.
    #[inline]
    pub fn vertex(&self, instance: Instance) -> Vertex {
        Vertex(self.first_vertex(instance.dag) + instance.subtask.0)
    }

    #[inline]
    pub(crate) fn first_vertex(&self, dag: DagId) -> u32 {
        self.first_vertices[dag.index()]
    }
}

impl Dag {
    /// Returns the name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the hash of the registered names and edges.
    pub const fn graph_hash(&self) -> u64 {
        self.graph_hash
    }

    /// Reports whether signals release the jobs, rather than the clock.
    pub const fn is_sporadic(&self) -> bool {
        matches!(self.activation, Activation::Sporadic)
    }

    /// Returns the time between two nominal releases; for a sporadic DAG the minimum inter-arrival
    /// time. Never 0.
    pub const fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// Returns the time after a release by which the job shall be complete: the largest deadline of
    /// its sinks, never 0.
    pub const fn relative_deadline_ns(&self) -> u64 {
        self.relative_deadline_ns
    }

    /// Returns the smallest relative deadline of its sinks.
    pub(crate) fn least_deadline_ns(&self) -> u64 {
        let of_subtasks = self.subtasks.iter().map(|of| of.relative_deadline_ns);
        of_subtasks.min().unwrap_or(self.relative_deadline_ns)
    }

    /// Returns the time of the first nominal release; for a sporadic DAG the earliest possible
    /// time.
    pub const fn offset_ns(&self) -> u64 {
        self.offset_ns
    }

    /// Returns the nominal release O + kT of job `job` of a periodic DAG, capped at the last
    /// representable time.
    pub const fn grid_ns(&self, job: u64) -> u64 {
        job.saturating_mul(self.period_ns)
            .saturating_add(self.offset_ns)
    }

    /// Returns the nominal release of a job. For a sporadic DAG this is `due_ns`.
    pub(crate) const fn release_ns(&self, job: u64, due_ns: u64) -> u64 {
        match self.is_sporadic() {
            true => due_ns,
            false => self.grid_ns(job),
        }
    }

    /// Returns the most jobs that may be in flight, never 0.
    pub const fn in_flight(&self) -> u32 {
        self.in_flight
    }

    /// Returns the number of slots for the jobs in flight: a power of two, so that finding a job's
    /// slot needs no division.
    pub(crate) fn slots(&self) -> usize {
        (self.in_flight as usize).next_power_of_two()
    }

    /// Returns the policy for a release beyond [`in_flight`](Self::in_flight).
    pub const fn overrun(&self) -> OverrunPolicy {
        self.overrun
    }

    /// Returns the cost of a fault of an instance.
    pub const fn on_fault(&self) -> OnFault {
        self.on_fault
    }

    /// Returns the longest time between the nominal releases of two consecutive jobs of a periodic
    /// DAG, not counting jobs lost to survived faults, as long as the DAG is not paused and no job
    /// is skipped or aborted.
    pub fn renewal_ns(&self) -> u64 {
        let lost_in_a_row = match self.on_fault {
            OnFault::EndDag => 0,
            // Another fault would fall into a window of these.
            OnFault::DropJob(limit) if u64::from(limit.faults) < limit.window => {
                limit.faults.min(limit.in_all)
            }
            OnFault::DropJob(limit) => limit.in_all,
        };
        self.period_ns.saturating_mul(1 + u64::from(lost_in_a_row))
    }

    /// Returns the first job to release: 0, except in a replay that begins later.
    pub const fn first_job(&self) -> u64 {
        self.first_job
    }

    /// Returns the number of jobs to release, counted from job 0 on, or `None` if there is no end.
    pub const fn jobs(&self) -> Option<u64> {
        self.jobs
    }

    /// Returns the subtasks in the order of registration, never empty.
    pub fn subtasks(&self) -> &[Subtask] {
        &self.subtasks
    }

    /// Returns a subtask.
    ///
    /// # Panics
    ///
    /// If `subtask` is not of this DAG.
    pub fn subtask(&self, subtask: SubtaskId) -> &Subtask {
        &self.subtasks[subtask.index()]
    }

    /// Reports whether some core of the cluster may not execute the DAG.
    pub(crate) fn is_confined(&self) -> bool {
        !self.affinity().is_empty()
    }

    /// Returns the subtasks without predecessor, ascending, never empty.
    pub fn sources(&self) -> &[SubtaskId] {
        &self.graph.sources
    }

    /// Returns the subtasks without successor, ascending, never empty. Includes subtasks with a
    /// stated deadline that precede another sink only because of a shared state.
    pub fn sinks(&self) -> &[SubtaskId] {
        &self.graph.sinks
    }

    /// Returns the direct predecessors of a subtask, each once, ascending.
    pub fn predecessors(&self, subtask: SubtaskId) -> &[SubtaskId] {
        self.graph.predecessors.neighbours(subtask)
    }

    /// Returns the direct successors of a subtask, each once, ascending.
    pub fn successors(&self, subtask: SubtaskId) -> &[SubtaskId] {
        self.graph.successors.neighbours(subtask)
    }

    /// Returns the topics, in the order of their writers. Edges stated without a topic are not
    /// among them.
    pub fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// Returns the subtasks in a topological order: every predecessor comes first.
    pub fn topological_order(&self) -> &[SubtaskId] {
        &self.graph.topological_order
    }

    /// Returns the edges that follow from shared states. They are among the predecessors and
    /// successors; an edge may have another reason, too.
    pub fn state_precedences(&self) -> &[StatePrecedence] {
        &self.state_precedences
    }

    /// Returns the uses of locks.
    pub fn locks(&self) -> &[LockUse] {
        &self.locks
    }

    /// Returns the first use of a lock without a stated longest section.
    pub fn unbounded_lock(&self) -> Option<&LockUse> {
        self.locks.iter().find(|of| of.longest_ns.is_none())
    }
}

impl Subtask {
    /// Returns the name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the worst-case execution time, if the app states one or a file has an observed one.
    pub const fn wcet_ns(&self) -> Option<u64> {
        self.wcet_ns
    }

    /// Returns the waits of the subtask, in order.
    pub const fn waits(&self) -> &[Wait] {
        &self.waits
    }

    /// Returns the sum of the limits of its waits, in nanoseconds.
    pub fn waiting_ns(&self) -> u64 {
        self.waits().iter().map(|wait| wait.limit_ns).sum()
    }

    /// Returns the WCETs of its segments, if known. A subtask without waits has a single segment.
    pub fn segments_ns(&self) -> Option<Vec<u64>> {
        let later = self.waits().iter().map(|wait| wait.segment_ns);
        let later = later.collect::<Option<Vec<u64>>>()?;
        let first = self.wcet_ns?.checked_sub(later.iter().sum())?;
        Some(core::iter::once(first).chain(later).collect())
    }

    /// Returns the WCET plus the [waits for locks](Self::lock_wait_ns).
    pub(crate) fn locking_wcet_ns(&self) -> Option<u64> {
        self.wcet_ns?.checked_add(self.lock_wait_ns)
    }

    /// Returns the WCETs of its segments. The first includes all waits for locks.
    pub(crate) fn locking_segments_ns(&self) -> Option<Vec<u64>> {
        let mut segments = self.segments_ns()?;
        segments[0] = segments[0].checked_add(self.lock_wait_ns)?;
        Some(segments)
    }

    /// Returns an upper bound on each of its segments, waits for locks included: the longest
    /// segment, or the whole WCET if only the sum is known.
    pub fn longest_segment_ns(&self) -> Option<u64> {
        let segments = self.locking_segments_ns();
        segments.map_or(self.locking_wcet_ns(), |segments| {
            segments.into_iter().max()
        })
    }

    /// Returns its WCET plus the charge `of_segment_ns` for each segment. Returns `None` if there
    /// is no WCET or the sum overflows.
    pub fn charged_ns(&self, of_segment_ns: u64) -> Option<u64> {
        let charge_ns = of_segment_ns.checked_mul(1 + self.waits.len() as u64)?;
        self.locking_wcet_ns()?.checked_add(charge_ns)
    }

    /// Returns the stack the subtask needs, in bytes, if the app stated it.
    pub const fn stack_bytes(&self) -> Option<u64> {
        self.stack_bytes
    }

    /// Returns the source of the WCET.
    pub const fn wcet_source(&self) -> WcetSource {
        self.wcet_source
    }

    /// Returns the longest allowed execution of an instance, in nanoseconds: the budget; without a
    /// budget, `wcets` times the WCET. `u64::MAX` means no limit: there is no budget, and no WCET
    /// or `wcets` is 0.
    pub fn most_execution_ns(&self, wcets: u64) -> u64 {
        let wcet_ns = self.wcet_ns.filter(|_| wcets > 0);
        let limit_ns = wcet_ns.map(|wcet_ns| wcet_ns.saturating_mul(wcets));
        self.budget_ns.or(limit_ns).unwrap_or(u64::MAX)
    }

    /// Returns the static priority, given or derived from the graph.
    pub const fn priority(&self) -> Priority {
        self.priority
    }

    /// Reports whether a started instance keeps its core until it finishes, fails or begins a wait,
    /// even if preemption is enabled.
    pub const fn is_non_preemptive(&self) -> bool {
        self.non_preemptive
    }

    /// Returns the time after a release by which the most urgent sink reachable from the subtask
    /// shall have finished; a sink reaches itself. Never 0.
    pub const fn relative_deadline_ns(&self) -> u64 {
        self.relative_deadline_ns
    }
}

impl TaskSet {
    /// Returns the sum of [`Dag::most_suspended`].
    #[inline(never)]
    pub fn most_suspended(&self) -> usize {
        self.dags().iter().map(Dag::most_suspended).sum()
    }

    /// Returns the size of a stack suitable for every subtask, if subtasks without a stated stack
    /// need `unstated` bytes.
    #[inline(never)]
    pub fn largest_stack_bytes(&self, unstated: u64) -> u64 {
        let subtasks = self.dags().iter().flat_map(Dag::subtasks);
        let bytes = subtasks.map(|subtask| subtask.stack_bytes().unwrap_or(unstated));
        bytes.max().unwrap_or(unstated)
    }
}

impl Dag {
    /// Returns an upper bound on the number of instances, of all jobs, suspended at once where
    /// started instances may lose their cores.
    pub fn most_suspended(&self) -> usize {
        let may_be = self.subtasks.iter().filter(|of| !of.is_non_preemptive());
        let may_be = may_be.count();
        let is_left = self.overrun == OverrunPolicy::Abort || self.on_fault != OnFault::EndDag;
        match is_left {
            true => may_be,
            false => may_be.min(self.chains().saturating_mul(self.in_flight as usize)),
        }
    }

    /// Returns the number of chains of a greedy cut of the graph: a subtask continues the chain of
    /// its first predecessor whose chain no other subtask has continued.
    fn chains(&self) -> usize {
        let mut is_continued = vec![false; self.subtasks.len()];
        let begins_one = |subtask: &&_| {
            let before = self.predecessors(**subtask).iter();
            let mut free = before.filter(|before| !is_continued[before.index()]);
            match free.next() {
                Some(before) => {
                    is_continued[before.index()] = true;
                    false
                }
                None => true,
            }
        };
        self.topological_order().iter().filter(begins_one).count()
    }
}

impl TaskSet {
    /// Divides the cores, and puts each DAG into a cluster, with the reason.
    pub(crate) fn divide(&mut self, sizes: &[u32], of_dags: &[(ClusterId, AssignmentReason)]) {
        self.clusters = sizes.into();
        for (dag, (cluster, why)) in self.dags.iter_mut().zip(of_dags) {
            (dag.cluster, dag.why_there) = (Some(*cluster), Some(*why));
        }
    }

    /// Lets a DAG execute only on these cores of its cluster.
    pub(crate) fn confine(&mut self, dag: DagId, cores: Vec<u32>) {
        self.dags[dag.index()].affinity = cores.into();
    }

    /// Returns the cores allowed to execute a DAG, ascending, on a machine of `all` cores.
    pub fn cores_of_dag(&self, dag: DagId, all: u32) -> Vec<u32> {
        let cluster = self.cores_of(self.dag(dag).cluster(), all);
        let lists = self.table_of(dag).map_or(&[][..], |table| &table.lists);
        // No DAG has both a list and an affinity.
        let stated = lists.iter().map(|list| &list.core);
        let stated = stated.chain(self.dag(dag).affinity());
        let stated: Vec<u32> = stated.map(|core| cluster.start + core).collect();
        match stated[..] {
            [] => cluster.collect(),
            _ => stated,
        }
    }

    /// Reports whether the cores are divided into clusters.
    pub const fn is_divided(&self) -> bool {
        !self.clusters.is_empty()
    }

    /// Returns the clusters; without a division, a single cluster of all cores.
    pub fn clusters(&self) -> impl Iterator<Item = ClusterId> + use<> {
        (0..).map(ClusterId).take(self.clusters.len().max(1))
    }

    /// Returns the cores of a cluster, on a machine of `all` cores.
    ///
    /// # Panics
    ///
    /// If there is no such cluster.
    #[inline(never)]
    pub fn cores_of(&self, cluster: ClusterId, all: u32) -> Range<u32> {
        if !self.is_divided() {
            return 0..all;
        }
        let (before, from_it_on) = self.clusters.split_at(cluster.index());
        let first = before.iter().sum();
        first..first + from_it_on[0]
    }

    /// Returns copies of the DAGs of a cluster.
    pub(crate) fn part(&self, cluster: ClusterId) -> Vec<Dag> {
        let dags = self.dags.iter();
        dags.filter(|dag| dag.cluster() == cluster)
            .cloned()
            .collect()
    }
}

impl Dag {
    /// Returns the cluster whose cores run the DAG; cluster 0 if the cores are not divided.
    pub fn cluster(&self) -> ClusterId {
        self.cluster.unwrap_or_default()
    }

    /// Returns why the commit has chosen the cluster; `None` if the commit has not chosen.
    pub const fn why_there(&self) -> Option<AssignmentReason> {
        self.why_there
    }

    /// Returns the cores of its cluster allowed to execute the DAG, ascending, counted from 0;
    /// empty: all.
    pub const fn affinity(&self) -> &[u32] {
        &self.affinity
    }

    /// Reports whether a cluster is stated, or chosen.
    pub const fn states_cluster(&self) -> bool {
        self.cluster.is_some()
    }
}
