//! What can be wrong with a record, in numbers and in words.

use core::fmt;

use crate::ids::{CoreId, DagId, Instance, SubtaskId};
use crate::policy::JobOutcome;

/// A rule of the task model; the [crate] states them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Rule {
    /// R1: jobs are released on the nominal grid, and nothing of one runs before.
    Release,
    /// R2: an instance is ready exactly when all that it waits for has happened.
    AndJoin,
    /// R3: no successor sees anything of an instance before its completion.
    CompletionBoundary,
    /// R4: a job is complete with its last sink, and meets its deadline or not.
    JobCompletion,
    /// R5: the instances with the smallest keys run, each once.
    Dispatch,
}

/// A breach of one of the model's rules in a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the fields' names are the words of the model")]
pub enum Violation {
    /// R1: the job's release time is not O + kT.
    OffGrid {
        dag: DagId,
        job: u64,
        release_ns: u64,
        grid_ns: u64,
    },
    /// R1: a sporadic job's release is less than one minimum inter-arrival time
    /// after the one before it, or before the offset.
    TooSoon {
        dag: DagId,
        job: u64,
        release_ns: u64,
        earliest_ns: u64,
    },
    /// R1 and the overrun policy: the release was carried out too early or,
    /// where times are exact, too late.
    ReleasedAtWrongTime {
        dag: DagId,
        job: u64,
        released_ns: u64,
        /// When it should have been; `None` if not yet.
        expected_ns: Option<u64>,
    },
    /// R1: something is recorded of an instance whose job was not released.
    NotReleased { instance: Instance },
    /// R1: the instance started before its job's nominal release.
    StartedBeforeRelease {
        instance: Instance,
        start_ns: u64,
        release_ns: u64,
    },
    /// R2: the instance was ready before all that it waits for had happened, or,
    /// where times are exact, later or not at all.
    ReadyAtWrongTime {
        instance: Instance,
        ready_ns: Option<u64>,
        /// When all had happened, `None` if it never did.
        expected_ns: Option<u64>,
    },
    /// R2: the instance started before it was ready.
    StartedBeforeReady {
        instance: Instance,
        start_ns: u64,
        ready_ns: u64,
    },
    /// R2: the instance started while its subtask still ran for an older job.
    OverlapsItself { instance: Instance, start_ns: u64 },
    /// R3: the instance started before a predecessor finished.
    StartedBeforePredecessor {
        instance: Instance,
        start_ns: u64,
        predecessor: SubtaskId,
        /// When the predecessor finished, `None` if it never did.
        finish_ns: Option<u64>,
    },
    /// R4: the job ended at another time than its last sink, or, where times
    /// are measured, earlier.
    EndedAtWrongTime {
        dag: DagId,
        job: u64,
        ended_ns: u64,
        /// When the last sink finished, `None` if one never did.
        last_sink_ns: Option<u64>,
    },
    /// R4: the job counts as something else than its times say.
    WrongOutcome {
        dag: DagId,
        job: u64,
        outcome: JobOutcome,
        /// Whether its deadline was seen to pass.
        missed: bool,
        finish_ns: u64,
        deadline_ns: u64,
    },
    /// R5: the instance of a job that ended was not run exactly once.
    NotRunOnce { instance: Instance, runs: u32 },
    /// R5: an instance waited although a core was idle, or ran an instance that
    /// it outranks and could have replaced.
    PassedOver {
        at_ns: u64,
        waiting: Instance,
        /// What ran instead, `None` if a core was idle.
        running: Option<Instance>,
    },
    /// R5: an instance that keeps its core lost it.
    LostItsCore { instance: Instance, at_ns: u64 },
    /// R5: an instance began on a core that was not free, or while it ran on
    /// another core already.
    CoreNotFree {
        core: CoreId,
        instance: Instance,
        at_ns: u64,
    },
}

impl Violation {
    /// Returns the rule that is broken.
    #[must_use]
    pub const fn rule(&self) -> Rule {
        match self {
            Self::OffGrid { .. }
            | Self::TooSoon { .. }
            | Self::ReleasedAtWrongTime { .. }
            | Self::NotReleased { .. }
            | Self::StartedBeforeRelease { .. } => Rule::Release,
            Self::ReadyAtWrongTime { .. }
            | Self::StartedBeforeReady { .. }
            | Self::OverlapsItself { .. } => Rule::AndJoin,
            Self::StartedBeforePredecessor { .. } => Rule::CompletionBoundary,
            Self::EndedAtWrongTime { .. } | Self::WrongOutcome { .. } => Rule::JobCompletion,
            Self::NotRunOnce { .. }
            | Self::PassedOver { .. }
            | Self::LostItsCore { .. }
            | Self::CoreNotFree { .. } => Rule::Dispatch,
        }
    }
}

/// Writes the rule's short name, such as `R2`.
impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Release => "R1",
            Self::AndJoin => "R2",
            Self::CompletionBoundary => "R3",
            Self::JobCompletion => "R4",
            Self::Dispatch => "R5",
        })
    }
}

/// A time, or that something never happened.
struct When(Option<u64>);

impl fmt::Display for When {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(time_ns) => write!(f, "at {time_ns} ns"),
            None => f.write_str("never"),
        }
    }
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.rule())?;
        match *self {
            Self::OffGrid {
                dag,
                job,
                release_ns,
                grid_ns,
            } => write!(
                f,
                "dag {} job {job} has its release at {release_ns} ns, the grid says {grid_ns} ns",
                dag.0
            ),
            Self::TooSoon {
                dag,
                job,
                release_ns,
                earliest_ns,
            } => write!(
                f,
                "dag {} job {job} has its release at {release_ns} ns, the minimum inter-arrival \
                 time allows {earliest_ns} ns",
                dag.0
            ),
            Self::ReleasedAtWrongTime {
                dag,
                job,
                released_ns,
                expected_ns,
            } => write!(
                f,
                "dag {} job {job} was released at {released_ns} ns, which should be {}",
                dag.0,
                When(expected_ns)
            ),
            Self::NotReleased { instance } => {
                write!(f, "{instance} is recorded, but its job was not released")
            }
            Self::StartedBeforeRelease {
                instance,
                start_ns,
                release_ns,
            } => write!(
                f,
                "{instance} started at {start_ns} ns, before its release at {release_ns} ns"
            ),
            Self::ReadyAtWrongTime {
                instance,
                ready_ns,
                expected_ns,
            } => write!(
                f,
                "{instance} was ready {}; all that it waits for had happened {}",
                When(ready_ns),
                When(expected_ns)
            ),
            Self::StartedBeforeReady {
                instance,
                start_ns,
                ready_ns,
            } => write!(
                f,
                "{instance} started at {start_ns} ns and was ready only at {ready_ns} ns"
            ),
            Self::OverlapsItself { instance, start_ns } => write!(
                f,
                "{instance} started at {start_ns} ns, while its subtask ran for an older job"
            ),
            Self::StartedBeforePredecessor {
                instance,
                start_ns,
                predecessor,
                finish_ns,
            } => write!(
                f,
                "{instance} started at {start_ns} ns; its predecessor, subtask {}, finished {}",
                predecessor.0,
                When(finish_ns)
            ),
            Self::EndedAtWrongTime {
                dag,
                job,
                ended_ns,
                last_sink_ns,
            } => write!(
                f,
                "dag {} job {job} ended at {ended_ns} ns; its last sink finished {}",
                dag.0,
                When(last_sink_ns)
            ),
            Self::WrongOutcome {
                dag,
                job,
                outcome,
                missed,
                finish_ns,
                deadline_ns,
            } => {
                let seen = if missed { "seen" } else { "not seen" };
                write!(
                    f,
                    "dag {} job {job}, complete at {finish_ns} ns with its deadline at \
                     {deadline_ns} ns, counts as {outcome:?} with a miss {seen}",
                    dag.0
                )
            }
            Self::NotRunOnce { instance, runs } => {
                write!(f, "{instance} ran {runs} times, not once")
            }
            Self::PassedOver {
                at_ns,
                waiting,
                running: Some(running),
            } => write!(
                f,
                "at {at_ns} ns {waiting} waits while {running} runs, which it outranks"
            ),
            Self::PassedOver {
                at_ns,
                waiting,
                running: None,
            } => write!(f, "at {at_ns} ns {waiting} waits while a core is idle"),
            Self::LostItsCore { instance, at_ns } => write!(
                f,
                "{instance} keeps its core until it finishes, but had to continue at {at_ns} ns"
            ),
            Self::CoreNotFree {
                core,
                instance,
                at_ns,
            } => write!(
                f,
                "{instance} began on core {} at {at_ns} ns while that ran something else, or \
                 while it ran elsewhere",
                core.0
            ),
        }
    }
}
