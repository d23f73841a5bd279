//! The task as the analysis sees it: numbers and a graph, nothing else.
//!
//! A [`Task`] is a DAG task reduced to what response-time analysis needs:
//! period, relative deadline, one WCET a subtask and the precedence edges. It
//! is made from a verified [`Dag`] with [`Task::from_dag`], or directly with
//! [`Task::new`] by tools and tests. It need not be connected and may have
//! several sources and sinks.
//!
//! Words: the *volume* is the sum of all WCETs; the *length* is the largest sum
//! of WCETs along a path. Both are computed once, checked against overflow, so
//! every other analysis may rely on `length <= volume <= u64::MAX`.
//!
//! No WCET is 0. All tests here count the work that delays a subtask, and one without
//! any would be delayed by what they do not count: say a subtask of WCET 0 becomes
//! ready at the very end of a busy period, as the last one of its job. All of the work
//! is done then, so the equations call the job complete; but a dispatch has yet to
//! choose it, and may choose the next job, which is released at this instant.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;
use core::fmt;

use crate::ids::SubtaskId;
use crate::task_set::Dag;

/// A DAG task: its timing and its weighted precedence graph.
#[derive(Clone, Debug)]
pub struct Task {
    period_ns: u64,
    relative_deadline_ns: u64,
    least_deadline_ns: u64,
    wcets_ns: Box<[u64]>,
    /// `starts[v]..starts[v + 1]` is the range of `v`'s successors.
    starts: Box<[usize]>,
    successors: Box<[usize]>,
    topological_order: Box<[usize]>,
    volume_ns: u64,
    length_ns: u64,
}

/// Why a DAG cannot be analysed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TaskError {
    /// No WCET above 0 is known for this subtask, perhaps for further ones.
    MissingWcet {
        /// The subtask.
        subtask: SubtaskId,
    },
    /// The sum of the WCETs (with overheads, if any were added) exceeds `u64`.
    VolumeOverflow,
    /// The period is 0.
    ZeroPeriod,
    /// The relative deadline is 0.
    ZeroDeadline,
    /// An edge names a subtask that does not exist.
    EdgeOutOfRange {
        /// The edge's first end.
        predecessor: usize,
        /// The edge's second end.
        successor: usize,
    },
    /// The edges form a cycle.
    Cycle,
}

impl Task {
    /// Makes a task from its timing, its WCETs and its precedence edges.
    ///
    /// Edges are `(predecessor, successor)` by position in `wcets_ns`, in any
    /// order; repeated and transitive ones change nothing.
    ///
    /// # Errors
    ///
    /// The first [`TaskError`] that is found.
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
        let (starts, successors) = adjacency(count, edges);
        let order = topological_order(&starts, &successors).ok_or(TaskError::Cycle)?;
        let mut ids = (0_u32..).map(SubtaskId).zip(&wcets_ns);
        if let Some((subtask, _)) = ids.find(|&(_, &wcet)| wcet == 0) {
            return Err(TaskError::MissingWcet { subtask });
        }
        Self::assemble(
            period_ns,
            relative_deadline_ns,
            wcets_ns,
            starts,
            successors,
            order,
        )
    }

    /// Makes a task from a verified DAG, adding `overhead_ns` to each WCET.
    ///
    /// See `Overheads` for what the overhead stands for.
    ///
    /// # Errors
    ///
    /// [`MissingWcet`](TaskError::MissingWcet) for the first subtask without one
    /// above 0, whatever the overhead, or
    /// [`VolumeOverflow`](TaskError::VolumeOverflow).
    pub fn from_dag(dag: &Dag, overhead_ns: u64) -> Result<Self, TaskError> {
        let order = dag.topological_order();
        let count = dag.subtasks().len();
        let mut wcets_ns = Vec::with_capacity(count);
        let mut starts = Vec::with_capacity(count + 1);
        let mut successors = Vec::new();
        starts.push(0);
        for (id, subtask) in (0_u32..).map(SubtaskId).zip(dag.subtasks()) {
            let wcet = (subtask.wcet_ns()).filter(|&wcet| wcet > 0);
            let charged = wcet
                .ok_or(TaskError::MissingWcet { subtask: id })?
                .checked_add(overhead_ns)
                .ok_or(TaskError::VolumeOverflow)?;
            wcets_ns.push(charged);
            successors.extend(dag.successors(id).iter().map(|other| other.index()));
            starts.push(successors.len());
        }
        let order = order.iter().map(|id| id.index()).collect();
        let task = Self::assemble(
            dag.period_ns(),
            dag.relative_deadline_ns(),
            wcets_ns,
            starts,
            successors,
            order,
        )?;
        Ok(Self {
            least_deadline_ns: dag.least_deadline_ns(),
            ..task
        })
    }

    fn assemble(
        period_ns: u64,
        relative_deadline_ns: u64,
        wcets_ns: Vec<u64>,
        starts: Vec<usize>,
        successors: Vec<usize>,
        topological_order: Vec<usize>,
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
            starts: starts.into(),
            successors: successors.into(),
            topological_order: topological_order.into(),
            volume_ns,
            length_ns: 0,
        };
        task.length_ns = task.bottom_levels().into_iter().max().unwrap_or(0);
        Ok(task)
    }

    /// Returns the time between two releases, never 0.
    #[must_use]
    pub const fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// Returns the relative deadline, never 0.
    #[must_use]
    pub const fn relative_deadline_ns(&self) -> u64 {
        self.relative_deadline_ns
    }

    /// Returns the least relative deadline of a sink, never 0.
    #[must_use]
    pub const fn least_deadline_ns(&self) -> u64 {
        self.least_deadline_ns
    }

    /// Returns the WCETs by subtask.
    #[must_use]
    pub const fn wcets_ns(&self) -> &[u64] {
        &self.wcets_ns
    }

    /// Returns the number of subtasks.
    #[must_use]
    pub const fn subtask_count(&self) -> usize {
        self.wcets_ns.len()
    }

    /// Returns the direct successors of a subtask.
    ///
    /// # Panics
    ///
    /// If there is no such subtask.
    #[must_use]
    pub fn successors(&self, subtask: usize) -> &[usize] {
        &self.successors[self.starts[subtask]..self.starts[subtask + 1]]
    }

    /// Returns the edges from a subtask: their numbers, and the successors.
    pub(super) fn edges_of(&self, subtask: usize) -> impl Iterator<Item = (usize, usize)> {
        let range = self.starts[subtask]..self.starts[subtask + 1];
        range.map(|edge| (edge, self.successors[edge]))
    }

    /// Returns the number of edges.
    #[must_use]
    pub const fn edge_count(&self) -> usize {
        self.successors.len()
    }

    /// Returns the subtasks in an order in which every predecessor comes first.
    #[must_use]
    pub const fn topological_order(&self) -> &[usize] {
        &self.topological_order
    }

    /// Returns the volume: the sum of all WCETs.
    #[must_use]
    pub const fn volume_ns(&self) -> u64 {
        self.volume_ns
    }

    /// Returns the length: the largest sum of WCETs along a path.
    #[must_use]
    pub const fn length_ns(&self) -> u64 {
        self.length_ns
    }
}

/// Sorts the edges by their predecessor: counting sort, stable.
fn adjacency(count: usize, edges: &[(usize, usize)]) -> (Vec<usize>, Vec<usize>) {
    let mut starts = vec![0; count + 1];
    for &(predecessor, _) in edges {
        starts[predecessor + 1] += 1;
    }
    for index in 0..count {
        starts[index + 1] += starts[index];
    }
    let mut next = starts.clone();
    let mut successors = vec![0; edges.len()];
    for &(predecessor, successor) in edges {
        successors[next[predecessor]] = successor;
        next[predecessor] += 1;
    }
    (starts, successors)
}

/// Orders the subtasks by precedence (Kahn 1962), or finds that none exists.
fn topological_order(starts: &[usize], successors: &[usize]) -> Option<Vec<usize>> {
    let count = starts.len() - 1;
    let mut waiting_for = vec![0_usize; count];
    for &successor in successors {
        waiting_for[successor] += 1;
    }
    let mut order: Vec<usize> = (0..count).filter(|&v| waiting_for[v] == 0).collect();
    let mut done = 0;
    while let Some(&subtask) = order.get(done) {
        done += 1;
        for &successor in &successors[starts[subtask]..starts[subtask + 1]] {
            waiting_for[successor] -= 1;
            if waiting_for[successor] == 0 {
                order.push(successor);
            }
        }
    }
    (order.len() == count).then_some(order)
}

impl fmt::Display for TaskError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::MissingWcet { subtask } => write!(
                f,
                "no WCET above 0 is given for subtask {}; give it one to have the DAG analysed",
                subtask.0
            ),
            Self::VolumeOverflow => {
                f.write_str("the sum of the WCETs exceeds 64 bits of nanoseconds; lower them")
            }
            Self::ZeroPeriod => f.write_str("the period is 0; give a positive one"),
            Self::ZeroDeadline => f.write_str("the relative deadline is 0; give a positive one"),
            Self::EdgeOutOfRange {
                predecessor,
                successor,
            } => write!(
                f,
                "edge {predecessor} -> {successor} names a subtask that does not exist; \
                 name subtasks by their position"
            ),
            Self::Cycle => f.write_str("the edges form a cycle; remove one of its edges"),
        }
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
        assert_eq!(task.topological_order(), [2, 0, 1]);
        assert_eq!((task.length_ns(), task.volume_ns()), (7, 7));
    }
}
