//! The task as the analysis sees it: numbers and a graph, nothing else.
//!
//! A [`Task`] is a DAG task reduced to the needs of response-time analysis: period, relative
//! deadline, one WCET a subtask and the precedence edges. [`Task::from_dag`] makes a task from a
//! verified [`Dag`]; tools and tests call [`Task::new`] directly. A task need not be connected and
//! may have several sources and sinks.
//!
//! Words: the *volume* is the sum of all WCETs; the *length* is the largest sum of WCETs along a
//! path. Both are computed once and checked against overflow, so every analysis may rely on
//! `length <= volume <= u64::MAX`. The *bottom level* (also *rank*) of a subtask is the largest sum
//! of WCETs along a path from the subtask on. The descending rank is the list order of HLF,
//! "highest level first" (T. C. Hu, Operations Research 9(6), 1961).
//!
//! A subtask may *wait* between its segments. Its WCET is then the sum over its segments, and three
//! more numbers are known: the sum of the limits of its waits, their number, and its longest
//! segment, the longest time on a core. The *span* is the largest sum of WCETs and limits along a
//! path. It is also the length of the *oblivious* task, where every subtask executes during its
//! waits.
//!
//! No WCET is 0. All tests here count the work delaying a subtask, and a subtask without work could
//! be delayed by something else. Say a subtask of WCET 0 becomes ready at the very end of a busy
//! period, as the last of its job. All work is done then, so the equations call the job complete.
//! But the dispatcher has yet to choose the subtask, and may choose the next job, released at this
//! very instant.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;
use core::cmp::Reverse;
use core::ops::Add;

use crate::graph::Graph;
use crate::ids::{SubtaskId, to_u32};
use crate::task_set::{Dag, Subtask};
use crate::worded::texts;

/// A DAG task: its timing and its weighted precedence graph.
#[derive(Clone, Debug)]
pub struct Task {
    period_ns: u64,
    relative_deadline_ns: u64,
    least_deadline_ns: u64,
    wcets_ns: Box<[u64]>,
    pub(super) graph: Graph,
    volume_ns: u64,
    length_ns: u64,
    /// `None`: no subtask waits.
    waits: Option<Box<TaskWaits>>,
    table_terms: TableTerms,
}

/// The attributes relevant to a table alone; the default describes a sporadic DAG.
#[derive(Clone, Debug, Default)]
pub struct TableTerms {
    /// The offset of a periodic DAG in nanoseconds; `None`: the DAG is sporadic.
    pub offset_ns: Option<u64>,
    /// The subtasks that are not preempted.
    pub non_preemptive: Vec<usize>,
    /// The sinks with a relative deadline of their own, each with that deadline in nanoseconds.
    pub sink_deadlines_ns: Vec<(usize, u64)>,
}

/// The waits of a task's subtasks, by subtask, and the task with all waits executed.
#[derive(Clone, Debug)]
struct TaskWaits {
    of_subtasks: Box<[SubtaskWaits]>,
    oblivious: Task,
}

/// The waits of one subtask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SubtaskWaits {
    /// The number of waits.
    pub count: u32,
    /// The sum of the waits' limits, in nanoseconds.
    pub limits_ns: u64,
    /// The WCET of the longest segment, in nanoseconds; without waits the subtask's WCET.
    pub longest_segment_ns: u64,
}

texts! {
    /// Why a DAG cannot be analysed.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum TaskError {
        /// No WCET above 0 is known for this subtask, and perhaps for others.
        MissingWcet { subtask: SubtaskId } =
            "no WCET above 0 is given for subtask {}; give it one to have the DAG analysed",
            subtask.0;
        /// The sum of the WCETs (with overheads, if any were added) exceeds `u64`.
        VolumeOverflow = "the sum of the WCETs exceeds 64 bits of nanoseconds; lower them";
        /// The sum of the WCETs and of the limits of waits exceeds `u64`.
        WaitsOverflow =
            "the sum of the WCETs and of the limits of waits exceeds 64 bits of nanoseconds; lower \
             them";
        /// The period is 0.
        ZeroPeriod = "the period is 0; give a positive one";
        /// The relative deadline is 0.
        ZeroDeadline = "the relative deadline is 0; give a positive one";
        /// An edge names a subtask that does not exist.
        EdgeOutOfRange { predecessor: usize, successor: usize } =
            "edge {predecessor} -> {successor} names a subtask that does not exist; name subtasks \
             by their position";
        /// The edges form a cycle.
        Cycle = "the edges form a cycle; remove one of its edges";
    }
}

impl Task {
    /// Makes a task from its timing, its WCETs and its precedence edges.
    ///
    /// Edges are `(predecessor, successor)` by position in `wcets_ns`, in any order. Repeated and
    /// transitive edges change nothing.
    ///
    /// # Errors
    ///
    /// The first [`TaskError`] found.
    pub fn new(
        period_ns: u64,
        relative_deadline_ns: u64,
        wcets_ns: Vec<u64>,
        edges: &[(usize, usize)],
    ) -> Result<Self, TaskError> {
        let count = wcets_ns.len();
        for &(predecessor, successor) in edges {
            if predecessor >= count || successor >= count {
                return Err(TaskError::EdgeOutOfRange {
                    predecessor,
                    successor,
                });
            }
        }
        let edges = edges.iter().map(|&(from, to)| (to_u32(from), to_u32(to)));
        let graph = Graph::new(count, &edges.collect::<Vec<_>>());
        if !graph.is_acyclic() {
            return Err(TaskError::Cycle);
        }
        let mut ids = (0_u32..).map(SubtaskId).zip(&wcets_ns);
        if let Some((subtask, _)) = ids.find(|&(_, &wcet)| wcet == 0) {
            return Err(TaskError::MissingWcet { subtask });
        }
        Self::assemble(period_ns, relative_deadline_ns, wcets_ns, graph)
    }

    /// Makes a task from a verified DAG, adding `overhead_ns` to the WCET of each segment.
    ///
    /// See `Overheads` for the meaning of the overhead.
    ///
    /// # Errors
    ///
    /// [`MissingWcet`](TaskError::MissingWcet) for the first subtask without a WCET above 0,
    /// whatever the overhead, or [`VolumeOverflow`](TaskError::VolumeOverflow) or
    /// [`WaitsOverflow`](TaskError::WaitsOverflow).
    pub fn from_dag(dag: &Dag, overhead_ns: u64) -> Result<Self, TaskError> {
        let charge = |(subtask, of): (u32, &Subtask)| {
            let subtask = SubtaskId(subtask);
            let known = of.wcet_ns().is_some_and(|wcet_ns| wcet_ns > 0);
            let known = known
                .then_some(of)
                .ok_or(TaskError::MissingWcet { subtask })?;
            let charged_ns = known.charged_ns(overhead_ns);
            charged_ns.ok_or(TaskError::VolumeOverflow)
        };
        let wcets_ns = (0..).zip(dag.subtasks()).map(charge);
        let wcets_ns = wcets_ns.collect::<Result<Vec<u64>, _>>()?;
        let (period_ns, deadline_ns) = (dag.period_ns(), dag.relative_deadline_ns());
        let task = Self::assemble(period_ns, deadline_ns, wcets_ns, dag.graph.clone())?;
        let ids = 0..dag.subtasks().len();
        let keeps = |&id: &usize| dag.subtasks()[id].is_non_preemptive();
        let sinks = dag.sinks().iter().map(|id| id.index());
        let own = sinks.map(|id| (id, dag.subtasks()[id].relative_deadline_ns()));
        let task = task.with_table_terms(TableTerms {
            offset_ns: (!dag.is_sporadic()).then_some(dag.offset_ns()),
            non_preemptive: ids.filter(keeps).collect(),
            sink_deadlines_ns: own.filter(|&(_, ns)| ns != deadline_ns).collect(),
        });
        let task = Self {
            least_deadline_ns: dag.least_deadline_ns(),
            ..task
        };
        let mut subtasks = dag.subtasks().iter();
        if subtasks.all(|of| of.waits().is_empty()) {
            return Ok(task);
        }
        let waits = dag.subtasks().iter().map(|of| SubtaskWaits {
            count: to_u32(of.waits().len()),
            limits_ns: of.waiting_ns(),
            // No longer than the WCET, which grows by at least as much.
            longest_segment_ns: of.longest_segment_ns().unwrap_or(0) + overhead_ns,
        });
        task.with_waits(waits.collect())
    }

    /// Returns the task with waits of its subtasks, by their position.
    ///
    /// # Errors
    ///
    /// [`WaitsOverflow`](TaskError::WaitsOverflow).
    ///
    /// # Panics
    ///
    /// If the number of `waits` differs from the number of subtasks, or a longest segment exceeds
    /// the WCET of its subtask.
    pub fn with_waits(self, waits: Vec<SubtaskWaits>) -> Result<Self, TaskError> {
        assert_eq!(
            waits.len(),
            self.subtask_count(),
            "the waits are by subtask"
        );
        let whole_ns = self.wcets_ns.iter().zip(&waits).map(|(&wcet_ns, of)| {
            assert!(of.longest_segment_ns <= wcet_ns, "a segment is a part");
            let whole_ns = wcet_ns.checked_add(of.limits_ns);
            whole_ns.ok_or(TaskError::WaitsOverflow)
        });
        let whole_ns = whole_ns.collect::<Result<Vec<u64>, _>>()?;
        let (period_ns, deadline_ns) = (self.period_ns, self.relative_deadline_ns);
        let oblivious = Self::assemble(period_ns, deadline_ns, whole_ns, self.graph.clone());
        let waits = TaskWaits {
            of_subtasks: waits.into(),
            oblivious: oblivious.map_err(|_| TaskError::WaitsOverflow)?,
        };
        Ok(Self {
            waits: Some(Box::new(waits)),
            ..self
        })
    }

    /// Returns the task with further attributes relevant to its table.
    #[must_use]
    pub fn with_table_terms(self, table_terms: TableTerms) -> Self {
        Self {
            table_terms,
            ..self
        }
    }

    fn assemble(
        period_ns: u64,
        relative_deadline_ns: u64,
        wcets_ns: Vec<u64>,
        graph: Graph,
    ) -> Result<Self, TaskError> {
        if period_ns == 0 {
            return Err(TaskError::ZeroPeriod);
        }
        if relative_deadline_ns == 0 {
            return Err(TaskError::ZeroDeadline);
        }
        let volume_ns = wcets_ns
            .iter()
            .try_fold(0_u64, |sum, &wcet| sum.checked_add(wcet))
            .ok_or(TaskError::VolumeOverflow)?;
        let mut task = Self {
            period_ns,
            relative_deadline_ns,
            least_deadline_ns: relative_deadline_ns,
            wcets_ns: wcets_ns.into(),
            graph,
            volume_ns,
            length_ns: 0,
            waits: None,
            table_terms: TableTerms::default(),
        };
        task.length_ns = task.bottom_levels().into_iter().max().unwrap_or(0);
        Ok(task)
    }

    /// Returns the period, or the least time between two releases of a sporadic DAG, never 0.
    pub const fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// Returns the relative deadline, never 0.
    pub const fn relative_deadline_ns(&self) -> u64 {
        self.relative_deadline_ns
    }

    /// Returns the least relative deadline of a sink, never 0.
    pub const fn least_deadline_ns(&self) -> u64 {
        self.least_deadline_ns
    }

    /// Returns the time after its release by which a job must complete to be in time and not to
    /// overlap the next: its deadline, or the next release if earlier.
    pub(super) fn within_ns(&self) -> u64 {
        self.relative_deadline_ns.min(self.period_ns)
    }

    /// Returns the release of a job of lap 0, in nanoseconds from the beginning of the lap, in a
    /// table of this DAG alone or with other DAGs.
    pub const fn release_in_lap_ns(&self, job: i64, is_alone: bool) -> i64 {
        let offset_ns = match self.table_terms.offset_ns {
            Some(offset_ns) if !is_alone => offset_ns.cast_signed(),
            _ => 0,
        };
        job.wrapping_mul(self.period_ns.cast_signed())
            .wrapping_add(offset_ns)
    }

    /// Returns the attributes relevant to a table.
    pub const fn table_terms(&self) -> &TableTerms {
        &self.table_terms
    }

    /// Returns the WCETs by subtask.
    pub const fn wcets_ns(&self) -> &[u64] {
        &self.wcets_ns
    }

    /// Returns the number of subtasks.
    pub const fn subtask_count(&self) -> usize {
        self.wcets_ns.len()
    }

    /// Returns the direct successors of a subtask, ascending.
    ///
    /// # Panics
    ///
    /// If the subtask does not exist.
    pub fn successors(&self, subtask: usize) -> impl ExactSizeIterator<Item = usize> + Clone {
        let successors = &self.graph.successors;
        let of_subtask = &successors.neighbours[successors.range(subtask)];
        of_subtask.iter().map(|next| next.index())
    }

    /// Returns the edges from a subtask: their numbers, and the successors.
    pub(super) fn edges_of(&self, subtask: usize) -> impl Iterator<Item = (usize, usize)> {
        let edges = self.graph.successors.range(subtask);
        edges.zip(self.successors(subtask))
    }

    /// Returns the number of edges.
    pub const fn edge_count(&self) -> usize {
        self.graph.successors.neighbours.len()
    }

    /// Returns the subtasks in a topological order, every predecessor first.
    pub fn topological_order(&self) -> impl DoubleEndedIterator<Item = usize> {
        self.graph.topological_order.iter().map(|id| id.index())
    }

    /// Returns the subtasks without predecessor, ascending.
    pub(super) fn sources(&self) -> impl ExactSizeIterator<Item = usize> {
        self.graph.sources.iter().map(|id| id.index())
    }

    /// Returns the bottom level of each subtask.
    pub fn bottom_levels(&self) -> Vec<u64> {
        self.graph.levels(&self.wcets_ns)
    }

    /// Returns by subtask the longest path up to and including the subtask: the finish after the
    /// release, in nanoseconds, if every subtask takes its WCET, and none waits for a core or for
    /// anything else.
    pub(super) fn finishes_ns(&self) -> Vec<u64> {
        let mut finishes_ns = self.wcets_ns().to_vec();
        for subtask in self.topological_order() {
            for next in self.successors(subtask) {
                let through_ns = finishes_ns[subtask] + self.wcets_ns()[next];
                finishes_ns[next] = finishes_ns[next].max(through_ns);
            }
        }
        finishes_ns
    }

    /// Returns a longest path for the given weights; ties go to the smallest position.
    ///
    /// The weights replace the WCETs, and their sum must not overflow.
    ///
    /// # Panics
    ///
    /// If the number of `weights` differs from the number of subtasks.
    pub fn longest_path<W>(&self, weights: &[W]) -> Vec<usize>
    where
        W: Copy + Default + Ord + Add<Output = W>,
    {
        let levels = self.graph.levels(weights);
        self.descend(&levels, 0..levels.len())
    }

    /// Returns a longest path from a source on, different from [`longest_path`](Self::longest_path)
    /// only where weights are 0.
    pub(super) fn longest_complete_path<W>(&self, weights: &[W]) -> Vec<usize>
    where
        W: Copy + Default + Ord + Add<Output = W>,
    {
        self.descend(&self.graph.levels(weights), self.sources())
    }

    /// Returns the path that begins with the subtask of the highest level among `first` and always
    /// goes on with the successor of the highest level.
    fn descend<W: Copy + Ord>(
        &self,
        levels: &[W],
        first: impl Iterator<Item = usize>,
    ) -> Vec<usize> {
        let rank = |&subtask: &usize| (levels[subtask], Reverse(subtask));
        let mut at = first.max_by_key(rank);
        let mut path = Vec::new();
        while let Some(subtask) = at {
            path.push(subtask);
            at = self.successors(subtask).max_by_key(rank);
        }
        path
    }

    /// Returns the largest number of subtasks on one path.
    pub fn most_subtasks_on_a_path(&self) -> u64 {
        let counts = self.graph.levels(&vec![1; self.subtask_count()]);
        counts.into_iter().max().unwrap_or(0)
    }

    /// Returns the volume: the sum of all WCETs.
    pub const fn volume_ns(&self) -> u64 {
        self.volume_ns
    }

    /// Returns the length: the largest sum of WCETs along a path.
    pub const fn length_ns(&self) -> u64 {
        self.length_ns
    }

    /// Reports whether a subtask waits.
    pub const fn has_waits(&self) -> bool {
        self.waits.is_some()
    }

    /// Returns the waits by subtask; empty if no subtask waits.
    pub fn waits(&self) -> &[SubtaskWaits] {
        let waits = self.waits.as_ref();
        waits.map_or(&[], |waits| &waits.of_subtasks)
    }

    /// Returns the task with all waits executed for their limits; without waits, returns the task
    /// itself.
    pub fn oblivious(&self) -> &Self {
        let waits = self.waits.as_ref();
        waits.map_or(self, |waits| &waits.oblivious)
    }

    /// Returns the span: the largest sum of WCETs and of limits of waits along a path.
    pub fn span_ns(&self) -> u64 {
        self.oblivious().length_ns
    }
}

impl core::error::Error for TaskError {}

#[cfg(test)]
mod tests {
    use super::{SubtaskId, Task, TaskError};

    #[test]
    fn faults_are_named() {
        let make = |period, deadline, wcets: &[u64], edges: &[(usize, usize)]| {
            Task::new(period, deadline, wcets.to_vec(), edges).unwrap_err()
        };
        assert_eq!(make(0, 1, &[1], &[]), TaskError::ZeroPeriod);
        assert_eq!(make(1, 0, &[1], &[]), TaskError::ZeroDeadline);
        assert_eq!(make(1, 1, &[u64::MAX, 1], &[]), TaskError::VolumeOverflow);
        assert_eq!(make(1, 1, &[1, 1], &[(0, 1), (1, 0)]), TaskError::Cycle);
        let subtask = SubtaskId(1);
        assert_eq!(make(9, 9, &[1, 0], &[]), TaskError::MissingWcet { subtask });
        assert_eq!(
            make(1, 1, &[1, 1], &[(0, 2)]),
            TaskError::EdgeOutOfRange {
                predecessor: 0,
                successor: 2
            }
        );
    }

    #[test]
    fn indices_need_not_be_topological() {
        let task = Task::new(10, 10, vec![1, 2, 4], &[(2, 0), (0, 1), (2, 1)]).unwrap();
        assert!(task.topological_order().eq([2, 0, 1]));
        assert_eq!((task.length_ns(), task.volume_ns()), (7, 7));
    }

    #[test]
    fn the_longest_path_goes_to_the_first_subtasks_on_ties() {
        let task = Task::new(9, 9, vec![1, 2, 2, 1], &[(0, 2), (0, 1), (1, 3), (2, 3)]).unwrap();
        assert_eq!(task.longest_path(task.wcets_ns()), [0, 1, 3]);
        assert_eq!(task.longest_path(&[0, 0, 0, 0]), [0, 1, 3]);
        assert_eq!(task.most_subtasks_on_a_path(), 3);
    }
}
