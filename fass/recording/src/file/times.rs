//! The statistics of all jobs of a run that has ended.

use alloc::vec::Vec;

crate::recordable! {
    /// The end of a run: how many events there were, and the times of all jobs.
    ///
    /// ```
    /// use recording::{Chunk, Recording, Stream, Times};
    ///
    /// let mut record = Stream::begin(Vec::new());
    /// record.times(&Times { written: vec![7], ..Times::default() });
    /// let bytes = record.end();
    /// let recording = Recording::read(&bytes).unwrap();
    /// let Some(Chunk::Times(times)) = recording.chunks().next() else { panic!() };
    /// assert_eq!(times.written, [7]);
    /// ```
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct Times {
        /// By cluster, how many events its journal has taken.
        pub written: Vec<u64>,
        /// By DAG; empty if nothing was counted.
        pub dags: Vec<DagTimes>,
    }

    /// The times of a DAG's jobs.
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct DagTimes {
        /// From the nominal release to the last finish, of complete jobs.
        pub response: Counted,
        /// From the nominal release to the release.
        pub release_jitter: Counted,
        /// By subtask.
        pub subtasks: Vec<SubtaskTimes>,
    }

    /// The times of a subtask's instances.
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct SubtaskTimes {
        /// From the last finish of a predecessor to the start.
        pub join_latency: Counted,
        /// The time that its calls took, preemptions left out.
        pub execution: Counted,
        /// Of a sink of several: from the nominal release to its finish, its deadlines missed,
        /// and the proven bound.
        pub sink: Option<(Counted, u64, Option<u64>)>,
    }

    /// A histogram.
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct Counted {
        /// The least value, exactly.
        pub min_ns: u64,
        /// The highest value of each bucket that is not empty, and how many are in it; the last
        /// one is exact.
        pub buckets: Vec<(u64, u64)>,
    }
}
