//! A commit of a run, its model as it was accepted and what was proven of it; and the statistics of
//! all jobs of a run that has ended.

use alloc::string::String;
use alloc::vec::Vec;

crate::recordable! {
    /// DAGs that were committed together, and how they are scheduled.
    ///
    /// Numbers are those of the kernel: DAGs, subtasks and clusters count from 0, and times are
    /// in nanoseconds.
    ///
    /// ```
    /// use recording::{Commit, Chunk, Recording, Stream};
    ///
    /// let mut record = Stream::begin(Vec::new());
    /// record.commit(&Commit { cores: 2, ..Commit::default() });
    /// let bytes = record.end();
    /// let recording = Recording::read(&bytes).unwrap();
    /// let Some(Chunk::Commit(commit)) = recording.chunks().next() else { panic!() };
    /// assert_eq!(commit.cores, 2);
    /// ```
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct Commit {
        /// Whether instances are ordered by deadline rather than by priority.
        pub is_edf: bool,
        /// Whether an instance that has started may lose its core.
        pub is_preemptive: bool,
        /// All cores.
        pub cores: u32,
        /// The number of cores of each cluster; empty if cores are not divided.
        pub clusters: Vec<u32>,
        /// The analysis charges an instance with so much, if that has an end.
        pub charge_ns: Option<u64>,
        /// It charges so much for making another one ready.
        pub ready_ns: u64,
        /// The DAGs, in the order of their numbers.
        pub dags: Vec<CommittedDag>,
    }

    /// A DAG of a [`Commit`].
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct CommittedDag {
        /// Its name.
        pub name: String,
        /// The hash of its names and edges.
        pub hash: u64,
        /// Whether signals release it, rather than time.
        pub is_sporadic: bool,
        /// The period, or the least time between releases.
        pub period_ns: u64,
        /// From the nominal release to the deadline.
        pub relative_deadline_ns: u64,
        /// The nominal release of job 0.
        pub offset_ns: u64,
        /// The number of jobs, if it has an end.
        pub jobs: Option<u64>,
        /// The most jobs at a time.
        pub in_flight: u32,
        /// The fate of a job that is due while as many are in flight: 0 it waits, 1 it is
        /// skipped, 2 the oldest one is aborted.
        pub overrun: u8,
        /// If a fault costs a job only: the most faults within a window of jobs, the window, and
        /// the most in all.
        pub survives: Option<(u32, u64, u32)>,
        /// The cluster, if the app has chosen it.
        pub cluster: Option<u32>,
        /// The subtasks, in the order of their numbers.
        pub subtasks: Vec<CommittedSubtask>,
        /// The precedence edges, from a subtask to another one.
        pub edges: Vec<(u32, u32)>,
        /// The sinks with their relative deadlines.
        pub sinks: Vec<(u32, u64)>,
        /// The proven bound on its response time.
        pub bound_ns: Option<u64>,
        /// The topics.
        pub topics: Vec<CommittedTopic>,
        /// Of each state that orders two subtasks its name, the earlier and the later one.
        pub states: Vec<(String, u32, u32)>,
        /// The latest values that it samples: the subtask, the DAG that writes them, the number
        /// of the topic there, and how old they may be.
        pub samples: Vec<(u32, u32, u32, Option<u64>)>,
    }

    /// A subtask of a [`Commit`].
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct CommittedSubtask {
        /// Its name.
        pub name: String,
        /// Its priority; 0 is the highest.
        pub priority: u32,
        /// Whether it keeps its core once it has started.
        pub is_non_preemptive: bool,
        /// Its WCET, if it is stated.
        pub wcet_ns: Option<u64>,
    }

    /// A topic of a [`Commit`].
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct CommittedTopic {
        /// Its name.
        pub name: String,
        /// The type of its values.
        pub type_name: String,
        /// The subtask that writes it.
        pub writer: u32,
        /// The subtasks of the DAG that read it.
        pub readers: Vec<u32>,
        /// Whether DAGs sample its latest value.
        pub is_sampled: bool,
    }
}

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
