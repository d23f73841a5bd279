//! What a commit is verified against.
//!
//! Words: the *construction policy* says which shapes of graph are wanted. Its
//! default is the paper's: exactly one source and one sink, connected, and one
//! writer a topic. Every relaxation is a choice that the caller writes down.

use crate::clusters::Clusters;
use crate::policy::Policy;

/// What the verification is told besides the DAGs.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct CommitOptions {
    /// How ready instances will be ordered; decides which attributes are needed.
    pub policy: Policy,
    /// The number of cores that the scheduler will serve, at least 1.
    pub cores: u32,
    /// How these are divided.
    pub clusters: Clusters,
    /// Which shapes of graph are wanted.
    pub construction: ConstructionPolicy,
    /// The most instances that the jobs in flight of all DAGs may have: the sum
    /// over the DAGs of jobs in flight times subtasks. It bounds the memory that
    /// the scheduler and the edges' slots take. Default: 2^20.
    pub instance_limit: u32,
}

/// Which shapes of graph a commit accepts.
///
/// The default is the paper's: one source, one sink, one writer a topic, and
/// every subtask connected with every other when the edges' directions are
/// ignored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub struct ConstructionPolicy {
    /// How many subtasks may have no predecessor.
    pub sources: Count,
    /// How many subtasks may have no successor.
    pub sinks: Count,
    /// How many subtasks may write one topic. With [`Count::Several`] a reader
    /// waits for all of them.
    pub writers: Count,
    /// How many parts without an edge between them a DAG may fall into.
    pub parts: Count,
}

/// How many of something a DAG may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Count {
    /// Exactly one.
    #[default]
    One,
    /// One or more.
    Several,
}

impl CommitOptions {
    /// Returns options with the paper's construction policy.
    #[must_use]
    pub const fn new(policy: Policy, cores: u32) -> Self {
        Self {
            policy,
            cores,
            clusters: Clusters::Undivided,
            construction: ConstructionPolicy::paper(),
            instance_limit: 1 << 20,
        }
    }

    /// Returns the same options with another construction policy.
    #[must_use]
    pub const fn with_construction(mut self, construction: ConstructionPolicy) -> Self {
        self.construction = construction;
        self
    }

    /// Returns the same options with the cores divided.
    #[must_use]
    pub fn with_clusters(mut self, clusters: Clusters) -> Self {
        self.clusters = clusters;
        self
    }

    /// Returns the same options with another bound on instances in flight.
    #[must_use]
    pub const fn with_instance_limit(mut self, instance_limit: u32) -> Self {
        self.instance_limit = instance_limit;
        self
    }
}

impl ConstructionPolicy {
    /// Returns the paper's policy, which is the default.
    #[must_use]
    pub const fn paper() -> Self {
        Self::all(Count::One)
    }

    /// Returns the policy that accepts every acyclic graph.
    #[must_use]
    pub const fn any_graph() -> Self {
        Self::all(Count::Several)
    }

    const fn all(count: Count) -> Self {
        Self {
            sources: count,
            sinks: count,
            writers: count,
            parts: count,
        }
    }
}
