//! What a commit answers about deadlines.

use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use super::overheads::Overheads;
use super::task::TaskError;
use crate::ids::{DagId, SubtaskId};
use crate::policy::{Policy, Preemption};

/// Under what conditions the DAGs will run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// How ready instances are ordered.
    pub policy: Policy,
    /// Whether instances of preemptible subtasks may lose their core.
    pub preemption: Preemption,
    /// The number of identical cores, all for these DAGs.
    pub cores: u32,
    /// Costs of the platform, added to each WCET.
    pub overheads: Overheads,
}

/// The response-time bounds of a set of DAGs, as far as they are proven.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// The bound of each DAG, in the order of the commit; `None`: not proven.
    ///
    /// A bound stands for itself: DAGs that are not proven do not weaken it.
    pub bounds: Vec<Option<DagBound>>,
    /// The bound of each sink of each DAG, in the order of [`Dag::sinks`]: the most time
    /// from a job's nominal release to the sink's finish. `None`: its DAG is not proven.
    ///
    /// [`Dag::sinks`]: crate::Dag::sinks
    pub sinks_ns: Vec<Vec<Option<u64>>>,
    /// Why a DAG has no bound, in the order of the commit; `None`: it has one.
    pub reasons: Vec<Option<Reason>>,
    /// The first DAG that is not proven, and why; `None` if all are.
    pub first_failing: Option<NotProven>,
}

/// A proven response-time bound, at most the relative deadline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DagBound {
    /// The most time from a job's nominal release to its last finish.
    pub bound_ns: u64,
    /// The test that gave it.
    pub test: Test,
}

/// The test that gave a bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Test {
    /// The multi-path bound: nothing else can delay this DAG.
    Alone,
    /// Intra-task priorities (He et al. 2019): nothing else can delay this DAG.
    IntraTask,
    /// The multi-path bound under global fixed priorities.
    FixedPriority,
    /// The multi-path bound under global EDF.
    Edf,
    /// The multi-path bound of subtasks that keep their core.
    NonPreemptive,
    /// Jobs that overlap, with either policy.
    Pipelined,
    /// The multi-path bound in any work-conserving order: all other DAGs count in full.
    AnyOrder,
    /// Response-time analysis of one core under static priorities (Joseph and Pandya 1986).
    OneCore,
    /// Processor demand of one core under EDF (Baruah, Rosier and Howell 1990); the bound is
    /// the deadline itself.
    Demand,
    /// Capacity augmentation for EDF or RM (Li et al. 2014); the bound is the
    /// deadline itself.
    Capacity,
    /// Speed-up tests for EDF or DM (Bonifaci et al. 2013); the bound is the
    /// deadline itself.
    SpeedUp,
}

/// A DAG without a proven bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotProven {
    /// The DAG.
    pub dag: DagId,
    /// Why there is no bound.
    pub reason: Reason,
}

/// Why a DAG is not proven to meet its deadlines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// The DAG cannot be analysed: a WCET is missing or numbers overflow.
    Unknown(TaskError),
    /// There are no cores.
    NoCores,
    /// Certain to miss at WCETs: the longest path is longer than the deadline.
    LengthBeyondDeadline {
        /// The length, overheads included.
        length_ns: u64,
    },
    /// Certain to miss at WCETs: the longest path to a sink is longer than its deadline.
    PathBeyondDeadline {
        /// The sink.
        sink: SubtaskId,
        /// The length, overheads included.
        length_ns: u64,
    },
    /// The job has a bound, but this sink none that is within its own deadline.
    NoSinkBound {
        /// The sink.
        sink: SubtaskId,
    },
    /// Certain to fall behind at WCETs: a subtask needs more than a period.
    SubtaskBeyondPeriod {
        /// The subtask.
        subtask: SubtaskId,
    },
    /// Certain to fall behind at WCETs: with this DAG, in order of urgency, the
    /// DAGs need more than all cores.
    Overload,
    /// Another DAG, which may delay this one, is not proven itself.
    DelayedBy {
        /// The other DAG.
        dag: DagId,
    },
    /// No test bounds the response time by the deadline. That does not say
    /// that deadlines will be missed.
    NoBound,
    /// As [`NoBound`](Self::NoBound), but with more jobs allowed in flight
    /// there might be one.
    InFlightTooFew {
        /// The most jobs in flight as configured.
        in_flight: u32,
    },
    /// The analysis reached one of its limits on time or size of numbers.
    Limit,
}

impl Answer {
    /// Reports whether every DAG has a bound.
    #[must_use]
    pub const fn is_proven(&self) -> bool {
        self.first_failing.is_none()
    }
}

impl Reason {
    /// Reports whether deadlines will be missed when every instance takes its
    /// WCET, rather than merely not being proven to be met.
    #[must_use]
    pub const fn is_certain(&self) -> bool {
        matches!(
            self,
            Self::LengthBeyondDeadline { .. }
                | Self::PathBeyondDeadline { .. }
                | Self::SubtaskBeyondPeriod { .. }
                | Self::Overload
        )
    }
}

impl fmt::Display for Test {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Alone => "multiple paths",
            Self::IntraTask => "intra-task priorities (He et al. 2019)",
            Self::FixedPriority => "multiple paths under global fixed priorities",
            Self::Edf => "multiple paths under global EDF",
            Self::NonPreemptive => "multiple paths of non-preemptive subtasks",
            Self::Pipelined => "overlapping jobs",
            Self::AnyOrder => "multiple paths in any work-conserving order",
            Self::OneCore => "response times on one core (Joseph and Pandya 1986)",
            Self::Demand => "processor demand of one core (Baruah et al. 1990)",
            Self::Capacity => "capacity augmentation (Li et al. 2014)",
            Self::SpeedUp => "speed-up (Bonifaci et al. 2013)",
        })
    }
}

impl fmt::Display for NotProven {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "dag {} is not proven to meet its deadlines: {}",
            self.dag.0, self.reason
        )
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown(error) => error.fmt(f),
            Self::NoCores => f.write_str("there are no cores; give it at least one"),
            Self::LengthBeyondDeadline { length_ns } => write!(
                f,
                "its longest path alone takes {:?}, which is more than its relative deadline; \
                 shorten the path or relax the deadline",
                Duration::from_nanos(*length_ns)
            ),
            Self::PathBeyondDeadline { sink, length_ns } => write!(
                f,
                "the longest path to subtask {} alone takes {:?}, which is more than the relative \
                 deadline of that sink; shorten the path or relax the deadline",
                sink.0,
                Duration::from_nanos(*length_ns)
            ),
            Self::NoSinkBound { sink } => write!(
                f,
                "no test bounds the response time of subtask {} by the relative deadline of that \
                 sink (it may still meet it); add cores or relax the deadline",
                sink.0
            ),
            Self::SubtaskBeyondPeriod { subtask } => write!(
                f,
                "subtask {} alone takes more than a period; split it or lengthen the period",
                subtask.0
            ),
            Self::Overload => f.write_str(
                "up to it, the DAGs need more time than all cores have; \
                 add cores, lengthen periods or shorten subtasks",
            ),
            Self::DelayedBy { dag } => write!(
                f,
                "dag {}, which may delay it, is not proven itself; see to that one first",
                dag.0
            ),
            Self::NoBound => f.write_str(
                "no test bounds its response time by its relative deadline (it may still \
                 meet it); add cores, raise its priority or relax the deadline",
            ),
            Self::InFlightTooFew { in_flight } => write!(
                f,
                "no test bounds its response time by {in_flight} periods, the most jobs \
                 that it may have in flight; allow more, or relax the load"
            ),
            Self::Limit => f.write_str(
                "the analysis reached a limit; use a coarser unit of time, \
                 or deadlines of fewer periods",
            ),
        }
    }
}
