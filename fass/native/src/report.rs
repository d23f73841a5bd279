//! What comes of a run.

use sched_dag::DagStatistics;
use sched_dag::law::Violation;

use crate::pin::Pinning;

/// What came of a run.
#[derive(Clone, Debug)]
pub struct Report {
    /// The counters of each DAG.
    pub statistics: Vec<DagStatistics>,
    /// For each DAG, in how many jobs each of its sinks was late.
    pub sink_misses: Vec<Vec<u64>>,
    /// Whether the workers were pinned.
    pub pinning: Pinning,
}

/// What came of a run that was written down.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// The report of the run.
    pub report: Report,
    /// All breaches of rules R1 to R5, on the scheduler's clock.
    pub violations: Vec<Violation>,
    /// How many instances have finished.
    pub instances: u64,
    /// How many of them finished on each worker.
    pub by_worker: Vec<u64>,
}
