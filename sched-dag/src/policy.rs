//! The choices that govern scheduling besides the policy: preemption, priority, overrun, faults; and
//! what may become of a job.
//!
//! # Clusters: parts of the cores that schedule by themselves
//!
//! A commit may divide the cores. Each DAG then belongs to one cluster and runs on its cores
//! alone; rule R5 holds within each cluster. One cluster of all cores is global scheduling,
//! clusters of one core are partitioned scheduling.

use alloc::vec::Vec;
use core::time::Duration;

use crate::worded::texts;

/// The source of a DAG's releases: a period, or signals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Activation {
    /// The clock: job k is released at O + kT.
    #[default]
    Periodic,
    /// Signals ([`Request::Signal`](crate::lifecycle::Request::Signal)): one job each, but
    /// never two releases less than T apart, and none before O. T is then the
    /// minimum inter-arrival time.
    Sporadic,
}

/// Whether a started instance may lose its core.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Preemption {
    /// At every instant the instances with the smallest keys run.
    Enabled,
    /// A started instance keeps its core until it finishes.
    Disabled,
}

/// The urgency of a subtask under [`Policy::StaticPriority`](crate::Policy::StaticPriority).
///
/// The smaller number is the *higher* priority. There is no `Ord`, because
/// `a < b` would read as the opposite of what it means.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Priority(pub u32);

/// The policy for a release that finds as many jobs in flight as the DAG may have.
///
/// With J jobs in flight allowed, the release of job k is *blocked* while job
/// k - J, or an older one, is in flight: both would use the same slot of every
/// edge. Unless jobs were skipped, that is to say that J jobs are in flight.
///
/// Under every policy jobs are released in the order of their numbers, and a job
/// that is released late keeps its nominal release time, and so its deadline. A
/// miss is noticed when the deadline passes, also of a job that still waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum OverrunPolicy {
    /// The release waits until it is not blocked. Any number may wait, in
    /// constant memory.
    #[default]
    Queue,
    /// The release does not happen and is counted. Nothing ever waits.
    Skip,
    /// The oldest job in flight that is not aborted yet is aborted, and the
    /// release waits until it is not blocked.
    ///
    /// An aborted job starts no further instance; what has started goes on, and
    /// when nothing of it is left, the job is out of flight. If all jobs in
    /// flight are aborted already, the oldest waiting release is skipped.
    Abort,
}

/// The cost of a fault of an instance: the DAG, or its job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum OnFault {
    /// The DAG: it is ended.
    #[default]
    EndDag,
    /// The job, as long as faults are survived: the DAG goes on with the next one, and the
    /// subtask with another function. It is ended by a fault beyond that, and by one of a
    /// subtask that has no other function.
    DropJob(FaultLimit),
}

/// How many faults of a DAG are survived.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FaultLimit {
    /// The most faults within a [`window`](Self::window), at least 1.
    pub faults: u32,
    /// How many jobs that window has, at least 1.
    pub window: u64,
    /// The most faults in all, at least 1. Each may cost memory until the end of the run, so
    /// this bounds it.
    pub in_all: u32,
}

impl FaultLimit {
    /// Makes a limit of so many faults within so many jobs, and in all.
    #[must_use]
    pub const fn new(faults: u32, window: u64, in_all: u32) -> Self {
        Self {
            faults,
            window,
            in_all,
        }
    }
}

/// How a job ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum JobOutcome {
    /// All subtasks have finished by the deadline.
    Met,
    /// All subtasks have finished, the last one after the deadline.
    Missed,
    /// The job was aborted.
    Aborted,
    /// A fault of one of its instances has cut the job, and the DAG goes on.
    Failed,
    /// The DAG was ended while the job was in flight.
    DagEnded,
}

/// How a commit divides the cores.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub enum CoreDivision {
    /// Not at all: every DAG may use every core.
    #[default]
    Undivided,
    /// Into clusters of so many cores each, the first one from core 0 on. Each DAG states
    /// its own. Cores that are left run nothing.
    Of(Vec<u32>),
}

impl CoreDivision {
    /// Returns the cores of each cluster, nothing if they are not divided.
    pub fn sizes(&self) -> &[u32] {
        match self {
            Self::Undivided => &[],
            Self::Of(sizes) => sizes,
        }
    }
}

texts! {
    /// The ways in which cores are divided, in the order in which they are tried.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum LendingAttempt {
        /// All DAGs share all cores; none owns any.
        Whole = "attempt 0";
        /// Light DAGs are placed by density, the densest first.
        ByDensity = "attempt 1, by density";
        /// Light DAGs are placed by deadline, the shortest first.
        ByDeadline = "attempt 2, by deadline";
        /// As [`ByDensity`](Self::ByDensity), with squeezed lists.
        SqueezedByDensity = "attempt 3, squeezed, by density";
        /// As [`ByDeadline`](Self::ByDeadline), with squeezed lists.
        SqueezedByDeadline = "attempt 4, squeezed, by deadline";
        /// One table for as many DAGs as can have one, whose entries preempt less urgent ones.
        Nest = "attempt 5, one table";
        /// As [`Nest`](Self::Nest), with fewer preemptions.
        Lazy = "attempt 6, one table, lazy";
    }
}

texts! {
    /// Why an attempt to divide cores has failed, of a DAG or in general.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum AttemptFailure {
        /// The DAG has no place.
        Lent = "no place";
        /// Some DAG can execute in a table only.
        Excluded = "some dag needs a table";
        /// No DAG can have a table with others.
        Nothing =
            "no table, as none is proven next to a lock, a card or measured overheads, or the \
             periods have no short common multiple";
        /// The DAG neither fits into the table nor may execute in what that leaves.
        Member = "no room in the table";
        /// The DAG is late in the table, or no table closes.
        Late = "no table in time";
        /// The DAG has no place in what the table leaves.
        Place = "no place next to the table";
    }
}

texts! {
    /// Why the commit has put a DAG into its cluster. What is left is in hundredths of the time of
    /// the DAG's cores, after the work of all that execute there.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum AssignmentReason {
        /// It is heavy: a job has this much work, overheads included, to do within that time.
        Heavy { volume_ns: u64, within_ns: u64 } =
            "its own, as a job is {:?} of work within {:?}",
            Duration::from_nanos(*volume_ns), Duration::from_nanos(*within_ns);
        /// All DAGs share all cores.
        Whole { left_percent: u32 } = "all, with {left_percent} % of them left (attempt 0)";
        /// It is heavy and has a table of its own.
        Owner { attempt: LendingAttempt, volume_ns: u64, within_ns: u64, left_percent: u32 } =
            "its own by a table, as a job is {:?} of work within {:?}, with {left_percent} % of \
             them left ({attempt})",
            Duration::from_nanos(*volume_ns), Duration::from_nanos(*within_ns);
        /// It has a table with others: each of the cores runs a list of entries.
        Table { attempt: LendingAttempt, left_percent: u32 } =
            "those of its table, with {left_percent} % of them left ({attempt})";
        /// It shares what the tables of some cores leave.
        Member { attempt: LendingAttempt, left_percent: u32 } =
            "the first with room for it, with {left_percent} % of them left \
             ({attempt})";
        /// Its subtasks wait, and no sum of loads tells what fits on a core with those.
        Waits = "its own, as its subtasks wait";
        /// It is light: the cluster with the least load takes it.
        Light = "the emptiest one";
    }
}
