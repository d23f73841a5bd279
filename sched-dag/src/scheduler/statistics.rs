//! What the scheduler counts, one fixed set of numbers a DAG.

/// Counts over the jobs of one DAG since the scheduler was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct DagStatistics {
    /// Jobs released.
    pub released: u64,
    /// Jobs of which all subtasks have finished.
    pub completed: u64,
    /// Jobs whose deadline has passed before they were complete, whether they
    /// were released or still waited for their release.
    pub misses: u64,
    /// Misses since a job last met its deadline.
    pub consecutive_misses: u64,
    /// The most misses without a job between them that met its deadline.
    pub most_consecutive_misses: u64,
    /// Releases that did not happen.
    pub skips: u64,
    /// Jobs aborted.
    pub aborts: u64,
    /// Releases that had to wait for an older job to end.
    pub queued: u64,
    /// Signals to a sporadic DAG.
    pub signals: u64,
    /// Signals that came while an earlier one was still kept, or no job was left.
    pub dropped_signals: u64,
    /// Instances that a fault has ended.
    pub faults: u64,
    /// Jobs that a fault has cut while the DAG went on.
    pub failed: u64,
    /// Faults after which the DAG went on.
    pub restarts: u64,
    /// Jobs that were in flight when the DAG was ended, without those cut before.
    pub cut_short: u64,
    /// Releases that still waited for an older job when the DAG was ended.
    pub dropped: u64,
}

impl DagStatistics {
    #[inline]
    pub(super) fn count_miss(&mut self) {
        self.misses += 1;
        self.consecutive_misses += 1;
        self.most_consecutive_misses = self.most_consecutive_misses.max(self.consecutive_misses);
    }

    #[inline]
    pub(super) fn count_met(&mut self) {
        self.consecutive_misses = 0;
    }
}
