//! Analysis at commit: will every job meet its deadline?
//!
//! [`answer()`] gives each DAG of a commit a *bound*: no job ever takes longer from its nominal
//! release to its last finish, with any execution times up to the WCETs, whatever the offsets (only
//! the tests of tables and of certificates rely on the offsets stated). All tests here are
//! *sufficient*: a DAG without a bound is "not proven", not "infeasible". The app decides whether
//! to refuse unproven DAGs.
//!
//! # The parts
//!
//! | module | subject | source |
//! |---|---|---|
//! | `task`, `graph` | length, volume, bottom levels | |
//! | `cover` | the most work of disjoint chains, and the width, by a flow | Ahuja 1993; Dilworth |
//! | `multi_path` | one job of a DAG at a time, alone or among others | derived here |
//! | `waiting`, `whole_units` | the same for subtasks with waits | derived here |
//! | `intra_task` | one DAG alone, by its subtasks' priorities | He 2019 |
//! | `workload`, `interference` | the work of other DAGs meanwhile | Melani 2015, extended |
//! | `set` | the equations of all DAGs, solved exactly | |
//! | `blocking` | subtasks that keep their core | derived here |
//! | `pipelined` | overlapping jobs, `R > T` | derived here |
//! | `ratio` | sums of utilisations | |
//! | `ranks` | which DAG may delay which | |
//! | `case`, `overheads` | the analysable DAGs of a cluster, and their charges | |
//! | `features`, `schedulability` | features; tests covering them | Joseph 1986; Baruah 1990 |
//! | `judge` | the verdict at commit, also for sinks with deadlines of their own | |
//! | `assign` | the commit's own clusters, dedicated cores | Li 2014; Baruah 2015 |
//! | `list_schedule` | orders of a DAG on some cores | Graham 1969 |
//! | `lending`, `lent_cores` | tables of DAGs, and the time left to others | derived here |
//! | `table_making`, `table_check` | tables of several DAGs; the check of times | derived here |
//! | `abstraction`, `explore` | graphs of periodic DAGs keeping cores; search | Nasri 2019 |
//! | `certificate` | closed state lists of such graphs, carried along with a set | |
//! | `witness` | all data needed to check the bounds | |
//!
//! A sporadic DAG is analysed as if its period were its minimum inter-arrival time. Only the tests
//! of tables and of certificates rely on a grid of releases. The papers behind the other tests
//! assume sporadic tasks, and the equations count the jobs that fit into a window at that distance.
//! For a sporadic DAG the analysis calls a miss *certain* only when a path is longer than the
//! deadline, because signals may stay away.
//!
//! Each module cites its paper and states its assumptions and the traps avoided. The functions for
//! single tests take [`Task`]s in priority order and can be used on their own; [`answer()`] knows
//! which tests apply.
//!
//! # Words
//!
//! `m` is the number of cores, `T` the period, `D` the relative deadline, and `R` a response-time
//! bound; [`Task`] defines `volume` and `length`. A DAG *outranks* another if its instances win a
//! core over the other's.
//!
//! # Guaranteed
//!
//! - *Integers only*: times have 64 bits, products 128. Divisions round so that the result stays a
//!   bound, and an overflow is an error or "not proven".
//! - *No recursion*, and every loop has a limit. A limit reached means a larger bound, the next
//!   test, or "not proven" (often [`NotProvenReason::Limit`]), never a guess. Run time is nearly
//!   linear in subtasks and edges for a DAG of more than [`SUBTASK_LIMIT`] subtasks, and quadratic
//!   in the number of DAGs.
//! - *Evidence*: the property test in `tests/it/analysis/` simulates thousands of random sets and
//!   compares each observed response time with its bound.
//!
//! # Not guaranteed
//!
//! - An exceeded WCET voids the bounds of every DAG of its cluster, and where clusters share locks,
//!   of the other clusters, too.
//! - The platform's own time is covered as far as [`Overheads`] says.
//! - The cores must be identical and serve these DAGs only. If a commit divides the cores, each
//!   cluster is analysed by itself.
//! - The form for overlapping jobs rests on the argument in its module and on the evidence above,
//!   not on a reviewed proof. `docs/bounds.md` proves the multi-path bound, waits and tables.

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

/// The conditions under which the DAGs will run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AnalysisSettings {
    /// The order of ready instances.
    pub policy: Policy,
    /// Whether instances of preemptible subtasks may lose their core.
    pub preemption: Preemption,
    /// The number of identical cores, in all clusters together, serving these DAGs only.
    pub cores: u32,
    /// Costs of the platform, added to each WCET.
    pub overheads: Overheads,
}

impl AnalysisSettings {
    /// Makes the settings of a scheduler on a platform with these costs.
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

/// The response-time bounds of a set of DAGs, as far as proven.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AnalysisResult {
    /// The bound of each DAG, in the order of the commit; `None`: not proven.
    ///
    /// Each bound holds by itself, whenever unproven DAGs release and however late they run.
    pub bounds: Vec<Option<DagBound>>,
    /// The bound of each sink of each DAG, in the order of [`Dag::sinks`]: the most time
    /// from a job's nominal release to the sink's finish. `None`: its DAG is not proven.
    ///
    /// [`Dag::sinks`]: crate::Dag::sinks
    pub sinks_ns: Vec<Vec<Option<u64>>>,
    /// Why a DAG has no bound, in the order of the commit; `None`: a bound exists.
    pub reasons: Vec<Option<NotProvenReason>>,
    /// The first DAG without a proof, and the reason; `None` if all are proven.
    pub first_failing: Option<NotProven>,
}

/// A proven response-time bound, at most the relative deadline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DagBound {
    /// The most time from a job's nominal release to its last finish.
    pub bound_ns: u64,
    /// The test behind the bound.
    pub test: SchedulabilityTest,
}

texts! {
    /// The test behind a bound.
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
        /// Widths that fit the cores: no instance waits for a core, so the longest path is the
        /// bound.
        Widths = "widths that fit the cores";
        /// The times of the DAG's entries in a table: nothing else can delay them.
        Table = "its entries in a table";
        /// A certificate of the schedule-abstraction graph.
        Graph = "a certificate of its schedule-abstraction graph (Nasri et al. 2019)";
        /// Fixed priorities, in the time that tables leave on the DAG's cores.
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
    /// Why a DAG is not proven to meet its deadlines. Lengths include overheads, so a certain miss
    /// is certain only when the overheads, too, take as long as stated.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum NotProvenReason {
        /// The DAG cannot be analysed: a WCET is missing or numbers overflow.
        Unknown(error: TaskError) = "{error}";
        /// Certain to miss at WCETs: the longest path is longer than the deadline.
        LengthBeyondDeadline { length_ns: u64 } =
            "its longest path alone takes {:?}, which is more than its relative deadline; shorten \
             the path or relax the deadline", Duration::from_nanos(*length_ns);
        /// Certain to miss at WCETs: the longest path to a sink exceeds the sink's own deadline.
        PathBeyondDeadline { sink: SubtaskId, length_ns: u64 } =
            "the longest path to subtask {} alone takes {:?}, which is more than the relative \
             deadline of that sink; shorten the path or relax the deadline",
            sink.0, Duration::from_nanos(*length_ns);
        /// The job has a bound, but this sink has none within its own deadline.
        NoSinkBound { sink: SubtaskId } =
            "no test bounds the response time of subtask {} by the relative deadline of that sink \
             (it may still meet it); add cores or relax the deadline", sink.0;
        /// Certain to fall behind at WCETs: a subtask needs more than a period.
        SubtaskBeyondPeriod { subtask: SubtaskId } =
            "subtask {} alone takes more than a period; split it or lengthen the period", subtask.0;
        /// Certain to fall behind at WCETs: in order of urgency, the DAGs up to and including this
        /// DAG need more time than all cores have.
        Overload =
            "up to it, the DAGs need more time than all cores have; add cores, lengthen periods or \
             shorten subtasks";
        /// Another DAG without a proof may delay this DAG.
        DelayedBy { dag: DagId } =
            "dag {}, which may delay it, is not proven itself; see to that one first", dag.0;
        /// No test bounds the response time by the deadline. The DAG may still meet its deadlines.
        NoBound =
            "no test bounds its response time by its relative deadline (it may still meet it); add \
             cores or let the commit divide them, shorten what outranks it or relax the deadline";
        /// As [`NoBound`](Self::NoBound), but the equations do have a solution: this bound.
        BoundBeyondDeadline { bound_ns: u64 } =
            "the bound of its response time is {:?}, beyond its relative deadline (it may still \
             meet it); add cores or relax the deadline", Duration::from_nanos(*bound_ns);
        /// As [`NoBound`](Self::NoBound), but more jobs allowed in flight might lead to a bound.
        InFlightTooFew { in_flight: u32 } =
            "no test bounds its response time by {in_flight} periods, the most jobs that it may \
             have in flight; allow more, or relax the load";
        /// Subtasks wait, and the longest path with its waits exceeds the deadline or the period.
        SpanBeyondLimit { span_ns: u64, limit_ns: u64 } =
            "its longest path with all waits takes {:?}, more than its deadline or period of {:?}; \
             lower the limits or lengthen both",
            Duration::from_nanos(*span_ns), Duration::from_nanos(*limit_ns);
        /// Subtasks wait, and no test bounds the response time of this DAG, or of a DAG that may
        /// delay it, by the respective period.
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
        /// Its table holds several DAGs, and something delays their entries without being charged.
        TableOverheads =
            "its table is of several DAGs, and no bound covers long steps, interrupts of a device or \
             sections of locks there; give each DAG a table of its own, or leave the lists out";
        /// A table runs on its cores, or holds its entries, and no test bounds it there.
        BesideTable =
            "a table runs on its cores, or has its entries, and no test bounds it there; let it have \
             subtasks that can be preempted and do not wait, and all without a table static priorities \
             that outrank DAG by DAG, or leave it cores without a table";
        /// Another DAG of its cluster is not proven and may release any number of jobs in a row,
        /// because no limit on its jobs is taken into account.
        BesideBacklog { dag: DagId } =
            "dag {}, which shares its cores, is not proven and queues releases that find no room: many \
             in a row may keep the scheduler from all others; see to that one first, or let it skip \
             or abort jobs", dag.0;
        /// A subtask of its cluster enters a lock without a stated longest section.
        UnboundedLock { dag: DagId, subtask: SubtaskId } =
            "subtask {} of dag {} enters a lock without a longest section, in which it keeps what \
             shares its cores waiting; state one by `Lock::longest`", subtask.0, dag.0;
        /// The set has a certificate, but the certificate proves nothing.
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
    /// Reports whether deadlines are certain to be missed when every instance takes its WCET with
    /// all overheads, and jobs keep coming, rather than merely not proven to be met.
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
