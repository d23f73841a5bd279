//! Clusters: parts of the cores that schedule by themselves.
//!
//! A commit may divide the cores. Each DAG then belongs to one cluster and runs on its cores
//! alone; rule R5 holds within each cluster. One cluster of all cores is global scheduling,
//! clusters of one core are partitioned scheduling.

use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

/// How a commit divides the cores.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub enum Clusters {
    /// Not at all: every DAG may use every core.
    #[default]
    Undivided,
    /// Into clusters of so many cores each, the first one from core 0 on. Each DAG states
    /// its own. Cores that are left run nothing.
    Of(Vec<u32>),
}

impl Clusters {
    /// Returns the cores of each cluster, nothing if they are not divided.
    #[must_use]
    pub fn sizes(&self) -> &[u32] {
        match self {
            Self::Undivided => &[],
            Self::Of(sizes) => sizes,
        }
    }
}

/// Why the commit has put a DAG into its cluster.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Why {
    /// It is heavy.
    Heavy {
        /// The work of a job, overheads included.
        volume_ns: u64,
        /// By when it is to be done.
        within_ns: u64,
    },
    /// It is light, and there the load was least.
    Light,
}

impl fmt::Display for Why {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Heavy {
                volume_ns,
                within_ns,
            } => write!(
                f,
                "its own, as a job is {:?} of work within {:?}",
                Duration::from_nanos(*volume_ns),
                Duration::from_nanos(*within_ns)
            ),
            Self::Light => f.write_str("the emptiest one"),
        }
    }
}
