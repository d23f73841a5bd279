//! Analysis at commit: will every job meet its deadline?
//!
//! [`answer()`] gives each DAG of a commit a *bound*: no job of it ever takes
//! longer from its nominal release to its last finish, whatever the offsets,
//! with any execution times up to the WCETs. All tests here are *sufficient*:
//! a DAG without a bound is "not proven", which is not "infeasible". Refusing
//! what is not proven is the app's choice.
//!
//! # The parts
//!
//! | module | what | source |
//! |---|---|---|
//! | `task`, `graph` | length, volume, bottom levels | |
//! | `cover` | the most work of disjoint chains, and the width, by a flow | Ahuja 1993; Dilworth |
//! | `multi_path` | one job of a DAG at a time, alone or among others | derived here |
//! | `waiting`, `whole_units` | the same of subtasks that wait | derived here |
//! | `intra_task` | one DAG alone, by its subtasks' priorities | He 2019 |
//! | `workload`, `interference` | what other DAGs execute meanwhile | Melani 2015, extended |
//! | `set` | the equations of all DAGs, solved exactly | |
//! | `blocking` | subtasks that keep their core | derived here |
//! | `pipelined` | overlapping jobs, `R > T` | derived here |
//! | `ratio` | sums of utilisations | |
//! | `ranks` | which DAG may delay which | |
//! | `case`, `overheads` | the DAGs of a cluster that can be analysed, with what they are charged | |
//! | `features`, `schedulability` | what enters a DAG; the tests, each with what it covers | Joseph and Pandya 1986; Baruah 1990 |
//! | `judge` | the verdict at commit, also for sinks with deadlines of their own | |
//! | `assign` | the commit's own clusters, dedicated cores | Li 2014; Baruah 2015 |
//! | `list_schedule` | orders of a DAG on some cores | Graham 1969 |
//! | `lending`, `lent_cores` | tables of DAGs, and what these leave to others | derived here |
//! | `table_making`, `table_check` | tables of several DAGs; whether a table keeps its times | derived here |
//! | `abstraction`, `explore` | the schedule-abstraction graph of periodic DAGs that keep cores; its search | Nasri, Nelissen, Brandenburg 2019 |
//! | `certificate` | closed lists of these graphs, which travel with a set | |
//! | `witness` | what it takes to check the bounds | |
//!
//! A sporadic DAG counts as one of its minimum inter-arrival time. No test here
//! but that of tables uses that releases lie on a grid: their papers' model is the sporadic one, and
//! the equations count the jobs that fit into a window at that distance. That a
//! deadline is *certain* to be missed is not said of sporadic DAGs, except by a path that
//! is longer than the deadline, since their signals may stay away.
//!
//! Each module cites its paper and states its assumptions and the traps that it
//! avoids. The functions for single tests take [`Task`]s in priority order and
//! stand for themselves; [`answer()`] knows which of them apply.
//!
//! # Words
//!
//! `m` is the number of cores, `T` the period, `D` the relative deadline, `R` a
//! response-time bound, `volume` and `length` are as in [`Task`]. A DAG
//! *outranks* another where its instances win a core over the other's.
//!
//! # What is guaranteed
//!
//! - *Integers only*: 64-bit times, 128-bit products; divisions round so that
//!   the result stays a bound, and an overflow is an error or "not proven".
//! - *No recursion*, and every loop has a limit; a limit reached is "not
//!   proven" ([`NotProvenReason::Limit`]), never a guess. Time is near linear in
//!   subtasks and edges for a DAG of more than [`SUBTASK_LIMIT`] subtasks, and quadratic in the
//!   number of DAGs.
//! - *Evidence*: the property test in `tests/it/analysis/` simulates thousands of
//!   random sets and compares each observed response time with its bound.
//!
//! # What is not
//!
//! - A WCET that is exceeded voids the bounds of every DAG.
//! - Time that the platform takes is covered as far as [`Overheads`] says.
//! - The cores must be identical and serve these DAGs only. Where they are divided, each
//!   cluster is analysed by itself.
//! - The form of overlapping jobs rests on the argument given in its module and on that
//!   evidence, not on a reviewed proof. The multi-path bound, waits and tables are proven in
//!   `docs/bounds.md`.

mod abstraction;
mod assign;
mod blocking;
mod case;
mod certificate;
mod cover;
mod explore;
mod features;
mod interference;
mod intra_task;
mod judge;
mod lending;
mod lent_cores;
mod list_schedule;
mod multi_path;
mod overheads;
mod pipelined;
mod ranks;
mod ratio;
pub(crate) use ratio::greatest_common_divisor;
mod schedulability;
mod set;
mod table_check;
mod table_making;
mod task;
mod waiting;
mod whole_units;
mod witness;
mod witness_text;
mod workload;

use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use crate::ids::{DagId, SubtaskId};
use crate::policies::{Policy, SchedulerOptions};
use crate::policy::Preemption;
use crate::worded::texts;

pub use abstraction::{
    AbstractState, AbstractionDag, AbstractionSet, AbstractionSubtask, INSTANCE_LIMIT, NotClosed,
    check_closed,
};
pub use assign::{AssignmentFailure, FailedAttempts, Federation, NotAssigned, assign, federated};
pub use cover::{covers, parallelism, width};
pub use explore::{STATE_LIMIT, explore};
pub use interference::InterferenceBound;
pub use intra_task::{PATH_LIMIT, SUBTASK_LIMIT, intra_task};
pub use judge::{answer, bounds_by_test, certify};
pub use lending::{CoreOwner, LendingAnswer, LendingPlan, LentGroup, lend};
pub use lent_cores::CoreSupply;
pub use list_schedule::{ListSchedule, ScheduledSubtask};
pub use multi_path::multi_path;
pub use overheads::{OverheadSource, Overheads};
pub use set::{multi_path_edf, multi_path_fp};
pub use table_check::{TableCondition, TableDag, TableFault, TableTimes, check_table};
pub use task::{SubtaskWaits, TableTerms, Task, TaskError};
pub use whole_units::{AloneBounds, WaitingForm, alone_forms, waiting_edf, waiting_fp};
pub use witness::witness;

/// Under what conditions the DAGs will run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AnalysisSettings {
    /// How ready instances are ordered.
    pub policy: Policy,
    /// Whether instances of preemptible subtasks may lose their core.
    pub preemption: Preemption,
    /// The number of identical cores, all for these DAGs.
    pub cores: u32,
    /// Costs of the platform, added to each WCET.
    pub overheads: Overheads,
}

impl AnalysisSettings {
    /// Makes those of a scheduler, whose platform has these costs.
    #[must_use]
    pub const fn new(scheduler: SchedulerOptions, overheads: Overheads) -> Self {
        Self {
            policy: scheduler.policy,
            preemption: scheduler.preemption,
            cores: scheduler.cores,
            overheads,
        }
    }

    /// Returns the scheduler's options.
    #[must_use]
    pub const fn scheduler(&self) -> SchedulerOptions {
        SchedulerOptions {
            policy: self.policy,
            preemption: self.preemption,
            cores: self.cores,
        }
    }
}

/// The response-time bounds of a set of DAGs, as far as they are proven.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AnalysisResult {
    /// The bound of each DAG, in the order of the commit; `None`: not proven.
    ///
    /// A bound stands for itself: whenever DAGs that are not proven release, and however late they
    /// are, it holds.
    pub bounds: Vec<Option<DagBound>>,
    /// The bound of each sink of each DAG, in the order of [`Dag::sinks`]: the most time
    /// from a job's nominal release to the sink's finish. `None`: its DAG is not proven.
    ///
    /// [`Dag::sinks`]: crate::Dag::sinks
    pub sinks_ns: Vec<Vec<Option<u64>>>,
    /// Why a DAG has no bound, in the order of the commit; `None`: it has one.
    pub reasons: Vec<Option<NotProvenReason>>,
    /// The first DAG that is not proven, and why; `None` if all are.
    pub first_failing: Option<NotProven>,
}

/// A proven response-time bound, at most the relative deadline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DagBound {
    /// The most time from a job's nominal release to its last finish.
    pub bound_ns: u64,
    /// The test that gave it.
    pub test: SchedulabilityTest,
}

texts! {
    /// The test that gave a bound.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    pub enum SchedulabilityTest {
        /// The multi-path bound: nothing else can delay this DAG.
        Alone = "multiple paths";
        /// Intra-task priorities: nothing else can delay this DAG.
        IntraTask = "intra-task priorities (He et al. 2019)";
        /// The multi-path bound under global fixed priorities.
        FixedPriority = "multiple paths under global fixed priorities";
        /// The second form of the multi-path bound without its excess of 1.
        SharpClip = "multiple paths without the excess of 1";
        /// The multi-path bound under global EDF.
        Edf = "multiple paths under global EDF";
        /// The multi-path bound of subtasks that keep their core.
        NonPreemptive = "multiple paths of non-preemptive subtasks";
        /// Jobs that overlap, in any order.
        Pipelined = "overlapping jobs";
        /// The multi-path bound in any work-conserving order: all other DAGs count in full.
        AnyOrder = "multiple paths in any work-conserving order";
        /// Response-time analysis of one core under static priorities.
        OneCore = "response times on one core (Joseph and Pandya 1986)";
        /// Response-time analysis of one core under EDF.
        OneCoreEdf = "response times on one core under EDF (Guan and Yi 2014)";
        /// Windows of segments on one core under static priorities.
        Windows = "windows of segments on one core";
        /// Processor demand of one core under EDF; the bound is the deadline itself.
        Demand = "processor demand of one core (Baruah et al. 1990)";
        /// As many cores as can be needed at once: the longest path.
        Widths = "widths that fit the cores";
        /// The times of its entries in a table: nothing else can delay them.
        Table = "its entries in a table";
        /// A certificate of the schedule-abstraction graph.
        Graph = "a certificate of its schedule-abstraction graph (Nasri et al. 2019)";
        /// The rest of cores that tables leave, under fixed priorities.
        Member = "what tables leave of its cores";
        /// The multi-path bound on the cores of its group.
        InGroup = "multiple paths on a group of cores";
    }
}

/// A DAG without a proven bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotProven {
    /// The DAG.
    pub dag: DagId,
    /// Why there is no bound.
    pub reason: NotProvenReason,
}

texts! {
    /// Why a DAG is not proven to meet its deadlines. Lengths are those with overheads.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum NotProvenReason {
        /// The DAG cannot be analysed: a WCET is missing or numbers overflow.
        Unknown(error: TaskError) = "{error}";
        /// Certain to miss at WCETs: the longest path is longer than the deadline.
        LengthBeyondDeadline { length_ns: u64 } =
            "its longest path alone takes {:?}, which is more than its relative deadline; shorten \
             the path or relax the deadline", Duration::from_nanos(*length_ns);
        /// Certain to miss at WCETs: the longest path to a sink is longer than its deadline.
        PathBeyondDeadline { sink: SubtaskId, length_ns: u64 } =
            "the longest path to subtask {} alone takes {:?}, which is more than the relative \
             deadline of that sink; shorten the path or relax the deadline",
            sink.0, Duration::from_nanos(*length_ns);
        /// The job has a bound, but this sink none that is within its own deadline.
        NoSinkBound { sink: SubtaskId } =
            "no test bounds the response time of subtask {} by the relative deadline of that sink \
             (it may still meet it); add cores or relax the deadline", sink.0;
        /// Certain to fall behind at WCETs: a subtask needs more than a period.
        SubtaskBeyondPeriod { subtask: SubtaskId } =
            "subtask {} alone takes more than a period; split it or lengthen the period", subtask.0;
        /// Certain to fall behind at WCETs: with this DAG, in order of urgency, the
        /// DAGs need more than all cores.
        Overload =
            "up to it, the DAGs need more time than all cores have; add cores, lengthen periods or \
             shorten subtasks";
        /// Another DAG, which may delay this one, is not proven itself.
        DelayedBy { dag: DagId } =
            "dag {}, which may delay it, is not proven itself; see to that one first", dag.0;
        /// No test bounds the response time by the deadline. That does not say
        /// that deadlines will be missed.
        NoBound =
            "no test bounds its response time by its relative deadline (it may still meet it); add \
             cores or let the commit divide them, shorten what outranks it or relax the deadline";
        /// As [`NoBound`](Self::NoBound), but the equations give this bound.
        BoundBeyondDeadline { bound_ns: u64 } =
            "the bound of its response time is {:?}, beyond its relative deadline (it may still \
             meet it); add cores or relax the deadline", Duration::from_nanos(*bound_ns);
        /// As [`NoBound`](Self::NoBound), but with more jobs allowed in flight
        /// there might be one.
        InFlightTooFew { in_flight: u32 } =
            "no test bounds its response time by {in_flight} periods, the most jobs that it may \
             have in flight; allow more, or relax the load";
        /// Subtasks wait, and the longest path with its waits exceeds the deadline or the period.
        SpanBeyondLimit { span_ns: u64, limit_ns: u64 } =
            "its longest path with all waits takes {:?}, more than its deadline or period of {:?}; \
             lower the limits or lengthen both",
            Duration::from_nanos(*span_ns), Duration::from_nanos(*limit_ns);
        /// Subtasks wait, and no test bounds the response time by the period, or that of a DAG
        /// which may delay this one by its own.
        NoBoundByPeriod =
            "subtasks wait, and no test bounds the response time, or that of a DAG that may delay it, \
             by the period; add cores or let the commit divide them, shorten what outranks it or \
             lengthen the period";
        /// An entry of its table fails a condition.
        NotRight(fault: TableFault) =
            "its table is not right: subtask {} of dag {}, in job {} of the first lap, {}; change the \
             lists, or state them without times",
            fault.subtask.0, fault.dag.0, fault.job, fault.condition;
        /// The entries of its table end too late.
        LateInTable { subtask: SubtaskId, bound_ns: u64 } =
            "in its table subtask {} ends up to {:?} after the release, which is too late; start it \
             earlier in its list, or relax the deadline",
            subtask.0, Duration::from_nanos(*bound_ns);
        /// Its table is of several DAGs, and something delays entries that is not charged.
        TableOverheads =
            "its table is of several DAGs, and no bound covers long steps, interrupts of a device or \
             sections of locks there; give each DAG a table of its own, or leave the lists out";
        /// A table runs on its cores.
        BesideTable =
            "a table runs on its cores, or has its entries, and no test bounds it there; let it have \
             subtasks that can be preempted and do not wait, and all without a table static priorities \
             that outrank DAG by DAG, or leave it cores without a table";
        /// A DAG of its cluster is not proven, and may release any number of jobs in a row,
        /// for a limit of its jobs is not taken into account.
        BesideBacklog { dag: DagId } =
            "dag {}, which shares its cores, is not proven and queues releases that find no room: many \
             in a row may keep the scheduler from all others; see to that one first, or let it skip \
             or abort jobs", dag.0;
        /// A subtask of its cluster enters a lock of which no longest section is stated.
        UnboundedLock { dag: DagId, subtask: SubtaskId } =
            "subtask {} of dag {} enters a lock without a longest section, in which it keeps what \
             shares its cores waiting; state one by `Lock::longest`", subtask.0, dag.0;
        /// The set has a certificate that proves nothing.
        NoCertificate(fault: NotClosed) = "certificate: {fault}";
        /// The analysis reached one of its limits on time or size of numbers.
        Limit =
            "the analysis reached a limit; use a coarser unit of time, or deadlines of fewer \
             periods";
        /// There are no cores.
        NoCores = "there are no cores; give it at least one";
    }
}

impl AnalysisResult {
    /// Reports whether every DAG has a bound.
    pub fn is_proven(&self) -> bool {
        self.bounds.iter().all(Option::is_some)
    }
}

impl NotProvenReason {
    /// Reports whether deadlines will be missed when every instance takes its
    /// WCET, rather than merely not being proven to be met.
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

impl fmt::Display for NotProven {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "dag {} is not proven to meet its deadlines: {}",
            self.dag.0, self.reason
        )
    }
}
