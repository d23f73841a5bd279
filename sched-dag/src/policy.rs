//! The choices for scheduling besides the policy: preemption, priority, overrun, faults; and the
//! possible outcomes of a job.
//!
//! # Clusters: parts of the cores with their own scheduling
//!
//! A commit may divide the cores. Each DAG then belongs to one cluster and runs only on its cores;
//! rule R5 holds within each cluster. A single cluster of all cores is global scheduling, clusters
//! of one core are partitioned scheduling.

use alloc::vec::Vec;
use core::time::Duration;

use crate::worded::texts;

/// The source of a DAG's releases: a period, or signals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Activation {
    /// The clock: job k is released at O + kT.
    #[default]
    Periodic,
    /// Signals ([`Request::Signal`](crate::lifecycle::Request::Signal)): at most one job each,
    /// never two releases less than T apart, and none before O. T is then the minimum inter-arrival
    /// time.
    Sporadic,
}

/// Whether a started instance may lose its core.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Preemption {
    /// At every instant the instances with the smallest keys run, but a started instance of a
    /// non-preemptive subtask keeps its core.
    Enabled,
    /// A started instance keeps its core until it finishes, fails or begins a wait.
    Disabled,
}

/// The urgency of a subtask under [`Policy::StaticPriority`](crate::Policy::StaticPriority).
///
/// The smaller number is the *higher* priority. There is no `Ord`, because `a < b` would read as
/// the opposite of its meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Priority(pub u32);

/// The policy for a release when as many jobs are in flight as the DAG may have.
///
/// With J jobs in flight allowed, the release of job k is *blocked* while job k - J, or an older
/// job, is in flight: both would use the same slot of every edge. Unless jobs were skipped, blocked
/// means that J jobs are in flight.
///
/// Under every policy jobs are released in the order of their numbers. A job released late keeps
/// its nominal release time, and so its deadline. A miss is noticed when the deadline has passed,
/// even for a job still waiting.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum OverrunPolicy {
    /// The release waits until it is not blocked. Any number may wait, in constant memory; of a
    /// sporadic DAG at most one.
    #[default]
    Queue,
    /// The release does not happen and is counted. Nothing ever waits.
    Skip,
    /// The oldest job in flight that is not cut yet, by an abort or a fault, is aborted, and the
    /// release waits until it is not blocked.
    ///
    /// An aborted job starts no further instance, and its waiting instances are cancelled. The
    /// other started instances go on, and when no instance of the job is left, the job is out of
    /// flight. If all jobs in flight are cut already, the oldest waiting release is skipped.
    Abort,
}

/// The cost of a fault of an instance: the DAG, or its job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum OnFault {
    /// The DAG: it is ended.
    #[default]
    EndDag,
    /// The job, as long as faults are survived: the DAG goes on with the next job, and the subtask
    /// with another function. The DAG is ended by a fault beyond the limit, and by a fault of a
    /// subtask without another function.
    DropJob(FaultLimit),
}

/// The number of faults a DAG survives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FaultLimit {
    /// The most faults within a [`window`](Self::window), at least 1.
    pub faults: u32,
    /// The number of jobs in a window, at least 1.
    pub window: u64,
    /// The most faults in all, at least 1. Each may cost memory until the end of the run, so this
    /// limit bounds the memory.
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
    /// All subtasks have finished, each sink by its deadline.
    Met,
    /// All subtasks have finished, some sink after its deadline.
    Missed,
    /// The job was aborted.
    Aborted,
    /// A fault of an instance has cut the job, and the DAG goes on.
    Failed,
    /// The DAG was ended while the job was in flight and not cut.
    DagEnded,
}

/// How a commit divides the cores.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub enum CoreDivision {
    /// Not at all: every DAG may use every core.
    #[default]
    Undivided,
    /// Into clusters of so many cores each, the first cluster from core 0 on. Each DAG states its
    /// cluster. Remaining cores run nothing.
    Of(Vec<u32>),
}

impl CoreDivision {
    /// Returns the number of cores of each cluster; empty if the cores are not divided.
    pub fn sizes(&self) -> &[u32] {
        match self {
            Self::Undivided => &[],
            Self::Of(sizes) => sizes,
        }
    }
}

texts! {
    /// The ways of dividing the cores, in the order of the attempts.
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
        /// One table for as many DAGs as can have a table, whose entries preempt less urgent ones.
        Nest = "attempt 5, one table";
        /// As [`Nest`](Self::Nest), with fewer preemptions.
        Lazy = "attempt 6, one table, lazy";
    }
}

texts! {
    /// The reason why an attempt to divide cores has failed, for a DAG or in general.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum AttemptFailure {
        /// The DAG has no place.
        Lent = "no place";
        /// Some DAG can only execute in a table.
        Excluded = "some dag needs a table";
        /// No DAG can have a table with others.
        Nothing =
            "no table, as none is proven next to a lock, a card or measured overheads, or the \
             periods have no short common multiple";
        /// The DAG neither fits into the table nor may execute in the time left by the table.
        Member = "no room in the table";
        /// The DAG is late in the table, or no table closes.
        Late = "no table in time";
        /// The DAG has no place in the time left by the table.
        Place = "no place next to the table";
    }
}

texts! {
    /// The reason why the commit has put a DAG into its cluster. `left_percent` is the time left on
    /// the DAG's cores, in percent, after the work of all DAGs executing there.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum AssignmentReason {
        /// The DAG is heavy: a job has this much work, overheads included, to do within
        /// `within_ns`.
        Heavy { volume_ns: u64, within_ns: u64 } =
            "its own, as a job is {:?} of work within {:?}",
            Duration::from_nanos(*volume_ns), Duration::from_nanos(*within_ns);
        /// All DAGs share all cores.
        Whole { left_percent: u32 } = "all, with {left_percent} % of them left (attempt 0)";
        /// The DAG is heavy and has a table of its own.
        Owner { attempt: LendingAttempt, volume_ns: u64, within_ns: u64, left_percent: u32 } =
            "its own by a table, as a job is {:?} of work within {:?}, with {left_percent} % of \
             them left ({attempt})",
            Duration::from_nanos(*volume_ns), Duration::from_nanos(*within_ns);
        /// The DAG has a table with others: each of the cores runs a list of entries.
        Table { attempt: LendingAttempt, left_percent: u32 } =
            "those of its table, with {left_percent} % of them left ({attempt})";
        /// The DAG shares the time left by the tables of some cores.
        Member { attempt: LendingAttempt, left_percent: u32 } =
            "the first with room for it, with {left_percent} % of them left \
             ({attempt})";
        /// The DAG's subtasks wait, and with waits no sum of loads tells whether DAGs fit on a
        /// core.
        Waits = "its own, as its subtasks wait";
        /// The DAG is light: the cluster with the least load takes it.
        Light = "the emptiest one";
    }
}
