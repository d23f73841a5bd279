//! Names of things by index: DAGs, subtasks, instances and cores.
//!
//! Every id is an index into a table that was sized at commit, so looking one
//! up is one bounds-checked access. Ids follow the order of registration.

use core::fmt;

/// A DAG task, by its position among the DAGs of one commit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct DagId(pub u32);

/// A subtask, by its position among the subtasks of its DAG.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SubtaskId(pub u32);

/// A subtask, by its position among the subtasks of all DAGs of one commit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Vertex(pub u32);

/// A processor, by its position among the processors that the scheduler serves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CoreId(pub u32);

/// A cluster of cores, by its position among those of one commit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct ClusterId(pub u32);

/// A mode, by its position among those of one commit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ModeId(pub u32);

/// One execution of a subtask: the part of job `job` that `subtask` does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Instance {
    /// The DAG task.
    pub dag: DagId,
    /// The job, counted from 0 on the DAG's nominal release grid.
    pub job: u64,
    /// The subtask.
    pub subtask: SubtaskId,
}

impl DagId {
    /// Returns the position as an index into a table of DAGs.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

impl ClusterId {
    /// Returns the position as an index into a table of clusters.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

impl ModeId {
    /// Returns the position as an index into a table of modes.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

impl SubtaskId {
    /// Returns the position as an index into a DAG's table of subtasks.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

impl Vertex {
    /// Returns the position as an index into a table of all subtasks.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

impl CoreId {
    /// Returns the position as an index into a table of cores.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

impl fmt::Display for Instance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { dag, job, subtask } = self;
        write!(f, "dag {} job {job} subtask {}", dag.0, subtask.0)
    }
}

/// Returns an index as an id's number.
///
/// # Panics
///
/// If it does not fit, which the verification has excluded before.
pub(crate) fn to_u32(index: usize) -> u32 {
    u32::try_from(index).expect("counts are verified to fit 32 bits")
}
