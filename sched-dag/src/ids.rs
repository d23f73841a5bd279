//! Ids of DAGs, subtasks, instances and cores, by index.
//!
//! Every id is an index into a table with a size fixed at commit, so a lookup is one bounds-checked
//! access. Ids follow the order of registration.

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
    /// A DAG task, by position among the DAGs of one commit.
    DagId;
    /// A subtask, by position among the subtasks of its DAG.
    SubtaskId;
    /// A subtask, by position among the subtasks of all DAGs of one commit.
    Vertex;
    /// A processor, by position among the processors of a cluster's scheduler, or, in the events of
    /// a whole run, of the machine.
    CoreId;
    /// A cluster of cores, by position among the clusters of one commit.
    ClusterId;
    /// A mode, by position among the modes of one commit.
    ModeId;
}

/// One execution of a subtask: the part of job `job` done by `subtask`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Instance {
    /// The DAG task.
    pub dag: DagId,
    /// The job, counted from 0: on the nominal release grid of a periodic DAG, by signals of a
    /// sporadic DAG.
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

/// Writes an object by its name, as in "dag `lidar`", or as in "dag 3" without a name.
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
/// If the index does not fit. The verification has excluded such an index before.
pub(crate) fn to_u32(index: usize) -> u32 {
    u32::try_from(index).expect("counts are verified to fit 32 bits")
}
