//! Clusters: parts of the cores that schedule by themselves.
//!
//! A commit may divide the cores. Each DAG then belongs to one cluster and runs on its cores
//! alone; rule R5 holds within each cluster. One cluster of all cores is global scheduling,
//! clusters of one core are partitioned scheduling.

use alloc::vec::Vec;
use core::time::Duration;

use crate::worded::texts;

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

texts! {
    /// Why the commit has put a DAG into its cluster.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Why {
        /// It is heavy: so much work of a job, overheads included, is to be done within that time.
        Heavy { volume_ns: u64, within_ns: u64 } =
            "its own, as a job is {:?} of work within {:?}",
            Duration::from_nanos(*volume_ns), Duration::from_nanos(*within_ns);
        /// It is light, and there the load was least.
        Light = "the emptiest one";
    }
}
