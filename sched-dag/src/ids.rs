//! Names of things by index: DAGs, subtasks, instances and cores.
//!
//! Every id is an index into a table that was sized at commit, so looking one
//! up is one bounds-checked access. Ids follow the order of registration.

use core::fmt;

/// Declares ids.
macro_rules! ids {
    ($($(#[$about:meta])+ $Id:ident;)+) => {
        $(
            $(#[$about])+
            #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
            pub struct $Id(pub u32);

            impl $Id {
                /// Returns the position as an index into a table.
                pub const fn index(self) -> usize {
                    self.0 as usize
                }
            }
        )+
    };
}

ids! {
    /// A DAG task, by its position among the DAGs of one commit.
    DagId;
    /// A subtask, by its position among the subtasks of its DAG.
    SubtaskId;
    /// A subtask, by its position among the subtasks of all DAGs of one commit.
    Vertex;
    /// A processor, by its position among the processors that the scheduler serves.
    CoreId;
    /// A cluster of cores, by its position among those of one commit.
    ClusterId;
    /// A mode, by its position among those of one commit.
    ModeId;
}

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

impl Instance {
    /// Names an execution by its parts.
    pub const fn new(dag: DagId, job: u64, subtask: SubtaskId) -> Self {
        Self { dag, job, subtask }
    }
}

impl fmt::Display for Instance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { dag, job, subtask } = self;
        write!(f, "dag {} job {job} subtask {}", dag.0, subtask.0)
    }
}

/// Writes something by its name, as in "dag `lidar`", or as in "dag 3" if it has none.
pub(crate) fn named<'n>(kind: &'n str, number: u32, name: &'n str) -> impl fmt::Display + 'n {
    fmt::from_fn(move |f| match name {
        "" => write!(f, "{kind} {number}"),
        name => write!(f, "{kind} `{name}`"),
    })
}

/// Returns an index as an id's number.
///
/// # Panics
///
/// If it does not fit, which the verification has excluded before.
pub(crate) fn to_u32(index: usize) -> u32 {
    u32::try_from(index).expect("counts are verified to fit 32 bits")
}
