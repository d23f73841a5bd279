//! The verified model: what remains true for as long as the scheduler runs.
//!
//! Only the verification makes a [`TaskSet`], so its holder may rely on
//! acyclic graphs, non-zero periods and deadlines, and indices in range.
//!
//! # How many instances of a DAG can be suspended at once: each keeps a stack
//!
//! Only an instance that has started and may be preempted is suspended, and a subtask has one
//! started instance at a time (R2). Of one job no two started instances precede one another, so
//! there are as many at most as the graph is wide; and no wider than the number of chains that it
//! can be cut into (R. P. Dilworth, Annals of Mathematics 51, 1950). Chains are found greedily,
//! in one pass, which need not find the fewest.
//!
//! A job that is aborted, or cut by a fault that its DAG survives, makes room for the next one
//! while instances of it go on; then the jobs in flight are no limit.

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
    /// The cores of each cluster; none if they are not divided.
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
    /// Its sinks are also those that state a deadline.
    pub(crate) graph: Graph,
    pub(crate) state_precedences: Box<[StatePrecedence]>,
    pub(crate) topics: Box<[Topic]>,
    pub(crate) locks: Box<[LockUse]>,
}

/// An edge that two subtasks have because they share a state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StatePrecedence {
    /// The state's name.
    pub state: String,
    /// The subtask that uses it first in each job.
    pub earlier: SubtaskId,
    /// The subtask that waits for that one.
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
    /// The longest that an instance waits to enter all its sections.
    pub(crate) lock_wait_ns: u64,
}

impl TaskSet {
    /// Lets a DAG lose no job, for a replay: due releases queue, whatever it has stated. It has
    /// these jobs only, as its recording does; those before them are not released.
    pub fn replay(&mut self, dag: DagId, jobs: Range<u64>) {
        let dag = &mut self.dags[dag.index()];
        dag.overrun = OverrunPolicy::Queue;
        dag.first_job = jobs.start;
        dag.jobs = Some(dag.jobs.map_or(jobs.end, |stated| stated.min(jobs.end)));
    }

    /// Counts the subtasks of verified DAGs.
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

    /// Has these tables enforced, which are of whole DAGs and in the cores' range.
    #[doc(hidden)]
    pub fn set_tables(&mut self, tables: Vec<Table>) {
        self.tables = tables.into();
    }

    /// Fixes the set: no DAG is paused, resumed or ended from outside, and no mode entered. The text is
    /// a certificate for its analysis, which `certify` makes there.
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

    /// Returns the table of a DAG, which is in one or in none.
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

    /// Returns one DAG.
    ///
    /// # Panics
    ///
    /// If `dag` is not of this task set.
    pub fn dag(&self, dag: DagId) -> &Dag {
        &self.dags[dag.index()]
    }

    /// Returns the number of all DAGs' subtasks, which are the vertices from 0 on.
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

    /// Returns the hash of the names and edges that were registered.
    pub const fn graph_hash(&self) -> u64 {
        self.graph_hash
    }

    /// Reports whether signals release the jobs, rather than the clock.
    pub const fn is_sporadic(&self) -> bool {
        matches!(self.activation, Activation::Sporadic)
    }

    /// Returns the time between two nominal releases, of a sporadic DAG the
    /// minimum inter-arrival time; never 0.
    pub const fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// Returns the time after a release by which the job shall be complete, the largest
    /// of its sinks' deadlines, never 0.
    pub const fn relative_deadline_ns(&self) -> u64 {
        self.relative_deadline_ns
    }

    /// Returns the least relative deadline of its sinks.
    pub(crate) fn least_deadline_ns(&self) -> u64 {
        let of_subtasks = self.subtasks.iter().map(|of| of.relative_deadline_ns);
        of_subtasks.min().unwrap_or(self.relative_deadline_ns)
    }

    /// Returns the time of the first nominal release, of a sporadic DAG the
    /// earliest one.
    pub const fn offset_ns(&self) -> u64 {
        self.offset_ns
    }

    /// Returns the nominal release O + kT of a periodic DAG's job `job`, at most the
    /// last time there is.
    pub const fn grid_ns(&self, job: u64) -> u64 {
        job.saturating_mul(self.period_ns)
            .saturating_add(self.offset_ns)
    }

    /// Returns the nominal release of a job, which of a sporadic DAG was due then.
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

    /// Returns the number of slots for the jobs in flight: a power of two, so that
    /// finding a job's slot needs no division.
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

    /// Returns the longest time between the nominal releases of two jobs of a periodic DAG that
    /// follow each other and are not lost by faults that it survives, while it is not paused.
    pub fn renewal_ns(&self) -> u64 {
        let lost_in_a_row = match self.on_fault {
            OnFault::EndDag => 0,
            // One more would be within a window of these.
            OnFault::DropJob(limit) if u64::from(limit.faults) < limit.window => {
                limit.faults.min(limit.in_all)
            }
            OnFault::DropJob(limit) => limit.in_all,
        };
        self.period_ns.saturating_mul(1 + u64::from(lost_in_a_row))
    }

    /// Returns the first job to release: 0, but in a replay that begins later.
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

    /// Returns one subtask.
    ///
    /// # Panics
    ///
    /// If `subtask` is not of this DAG.
    pub fn subtask(&self, subtask: SubtaskId) -> &Subtask {
        &self.subtasks[subtask.index()]
    }

    /// Reports whether not every core of the cluster may execute it.
    pub(crate) fn is_confined(&self) -> bool {
        !self.affinity().is_empty()
    }

    /// Returns the subtasks without predecessor, ascending, never empty.
    pub fn sources(&self) -> &[SubtaskId] {
        &self.graph.sources
    }

    /// Returns the subtasks without successor, ascending, never empty; also those that
    /// state a deadline and precede another sink only because of a shared state.
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

    /// Returns the topics, in the order of their writers. Edges that were stated
    /// without a topic have none.
    pub fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// Returns the subtasks in an order in which every predecessor comes first.
    pub fn topological_order(&self) -> &[SubtaskId] {
        &self.graph.topological_order
    }

    /// Returns the edges that follow from shared states. They are among the
    /// predecessors and successors; there may be another reason for one, too.
    pub fn state_precedences(&self) -> &[StatePrecedence] {
        &self.state_precedences
    }

    /// Returns the uses of locks.
    pub fn locks(&self) -> &[LockUse] {
        &self.locks
    }

    /// Returns the first use of a lock of which no longest section is stated.
    pub fn unbounded_lock(&self) -> Option<&LockUse> {
        self.locks.iter().find(|of| of.longest_ns.is_none())
    }
}

impl Subtask {
    /// Returns the name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the worst-case execution time, if the app gave one.
    pub const fn wcet_ns(&self) -> Option<u64> {
        self.wcet_ns
    }

    /// Returns its waits, in order.
    pub const fn waits(&self) -> &[Wait] {
        &self.waits
    }

    /// Returns the sum of its waits' limits.
    pub fn waiting_ns(&self) -> u64 {
        self.waits().iter().map(|wait| wait.limit_ns).sum()
    }

    /// Returns the WCETs of its segments, if they are known; that of a subtask without waits is one.
    pub fn segments_ns(&self) -> Option<Vec<u64>> {
        let later = self.waits().iter().map(|wait| wait.segment_ns);
        let later = later.collect::<Option<Vec<u64>>>()?;
        let first = self.wcet_ns?.checked_sub(later.iter().sum())?;
        Some(core::iter::once(first).chain(later).collect())
    }

    /// Returns the WCET, and its [waits for locks](Self::lock_wait_ns).
    pub(crate) fn locking_wcet_ns(&self) -> Option<u64> {
        self.wcet_ns?.checked_add(self.lock_wait_ns)
    }

    /// Returns the WCETs of its segments, of which the first has all waits for locks.
    pub(crate) fn locking_segments_ns(&self) -> Option<Vec<u64>> {
        let mut segments = self.segments_ns()?;
        segments[0] = segments[0].checked_add(self.lock_wait_ns)?;
        Some(segments)
    }

    /// Returns a time that none of its segments exceeds, waits for locks included: that of the
    /// longest one, or of all together if that is all that is known.
    pub fn longest_segment_ns(&self) -> Option<u64> {
        let segments = self.locking_segments_ns();
        segments.map_or(self.locking_wcet_ns(), |segments| {
            segments.into_iter().max()
        })
    }

    /// Returns its WCET with what each of its segments is charged, `None` if there is none or the
    /// sum overflows.
    pub fn charged_ns(&self, of_segment_ns: u64) -> Option<u64> {
        let charge_ns = of_segment_ns.checked_mul(1 + self.waits.len() as u64)?;
        self.locking_wcet_ns()?.checked_add(charge_ns)
    }

    /// Returns the stack that it needs, in bytes, if the app stated one.
    pub const fn stack_bytes(&self) -> Option<u64> {
        self.stack_bytes
    }

    /// Returns where the WCET is from.
    pub const fn wcet_source(&self) -> WcetSource {
        self.wcet_source
    }

    /// Returns how long an instance may execute for, `u64::MAX` if there is no limit: its
    /// budget, else so many WCETs, or no limit if that is 0.
    pub fn most_execution_ns(&self, wcets: u64) -> u64 {
        let wcet_ns = self.wcet_ns.filter(|_| wcets > 0);
        let limit_ns = wcet_ns.map(|wcet_ns| wcet_ns.saturating_mul(wcets));
        self.budget_ns.or(limit_ns).unwrap_or(u64::MAX)
    }

    /// Returns the static priority, given or derived from the graph.
    pub const fn priority(&self) -> Priority {
        self.priority
    }

    /// Reports whether a started instance keeps its core until it finishes.
    pub const fn is_non_preemptive(&self) -> bool {
        self.non_preemptive
    }

    /// Returns the time after a release by which the most urgent of the sinks that it
    /// reaches shall have finished; a sink reaches itself. Never 0.
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

    /// Returns the size of a stack that every subtask can run on, if those that state none need
    /// so many bytes.
    #[inline(never)]
    pub fn largest_stack_bytes(&self, unstated: u64) -> u64 {
        let subtasks = self.dags().iter().flat_map(Dag::subtasks);
        let bytes = subtasks.map(|subtask| subtask.stack_bytes().unwrap_or(unstated));
        bytes.max().unwrap_or(unstated)
    }
}

impl Dag {
    /// Returns a number of instances, of all jobs, that is never exceeded by those that are
    /// suspended at once where started instances may lose their cores.
    pub fn most_suspended(&self) -> usize {
        let may_be = self.subtasks.iter().filter(|of| !of.is_non_preemptive());
        let may_be = may_be.count();
        let is_left = self.overrun == OverrunPolicy::Abort || self.on_fault != OnFault::EndDag;
        match is_left {
            true => may_be,
            false => may_be.min(self.chains().saturating_mul(self.in_flight as usize)),
        }
    }

    /// Returns the number of chains that the graph is cut into: a subtask goes on with the chain
    /// of the first predecessor that no other has gone on with.
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
    /// Divides the cores, and puts each DAG into a cluster for a reason.
    pub(crate) fn divide(&mut self, sizes: &[u32], of_dags: &[(ClusterId, AssignmentReason)]) {
        self.clusters = sizes.into();
        for (dag, (cluster, why)) in self.dags.iter_mut().zip(of_dags) {
            (dag.cluster, dag.why_there) = (Some(*cluster), Some(*why));
        }
    }

    /// Lets a DAG execute on these cores of its cluster only.
    pub(crate) fn confine(&mut self, dag: DagId, cores: Vec<u32>) {
        self.dags[dag.index()].affinity = cores.into();
    }

    /// Returns the cores that may execute a DAG, ascending, on a machine of `all`.
    pub fn cores_of_dag(&self, dag: DagId, all: u32) -> Vec<u32> {
        let cluster = self.cores_of(self.dag(dag).cluster(), all);
        let lists = self.table_of(dag).map_or(&[][..], |table| &table.lists);
        // No DAG has both.
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

    /// Returns the clusters; if the cores are not divided, the one of all cores.
    pub fn clusters(&self) -> impl Iterator<Item = ClusterId> + use<> {
        (0..).map(ClusterId).take(self.clusters.len().max(1))
    }

    /// Returns the cores of a cluster, on a machine of `all`.
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
    /// Returns the cluster whose cores run it; if the cores are not divided, cluster 0.
    pub fn cluster(&self) -> ClusterId {
        self.cluster.unwrap_or_default()
    }

    /// Returns why the commit has chosen that; `None` if it has not.
    pub const fn why_there(&self) -> Option<AssignmentReason> {
        self.why_there
    }

    /// Returns the cores of its cluster that execute it, ascending, counted from 0; empty: all.
    pub const fn affinity(&self) -> &[u32] {
        &self.affinity
    }

    /// Reports whether a cluster is stated, or chosen.
    pub const fn states_cluster(&self) -> bool {
        self.cluster.is_some()
    }
}
