//! What can be wrong with a journal.

use crate::ids::{CoreId, DagId, Instance};
use crate::journal::{Event, What};
use crate::law::sweep::{Stage, Wrong};

/// A rule of the task model, which the [crate] states, or one of two that every
/// machine must keep whatever the model says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Rule {
    /// R1: jobs are released on the nominal grid, and nothing of one runs before.
    Release,
    /// R2: an instance is ready exactly when all that it waits for has happened.
    AndJoin,
    /// R3: what waits for an instance is released when that has finished, all at once.
    CompletionBoundary,
    /// R4: a job is complete with its last instance, and meets its deadline or not.
    JobCompletion,
    /// R5: the instances with the smallest keys run.
    Dispatch,
    /// An instance becomes ready, starts and finishes once, is suspended and resumed in
    /// turns, and is on one core at a time.
    OneLife,
    /// A core runs one instance at a time.
    OneCore,
}

/// A breach of a rule in a journal.
///
/// Its text says what happened, where, and why it must not be; with the names of DAGs
/// and subtasks if it is printed [`with_names`](Self::with_names).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the fields' names are the words of the model")]
pub enum Violation {
    /// R1: something of a job happened before its nominal release.
    BeforeRelease { event: Event, release_ns: u64 },
    /// R1: something of a job happened before its release was carried out.
    BeforeReleased { event: Event, released_ns: u64 },
    /// R1: something of a job happened that was not released, or is forgotten, for a
    /// later one is complete. The first that happened; all else of it is not judged.
    NotReleased { event: Event, is_over: bool },
    /// R1: nothing says when a sporadic job was due.
    NotDue { event: Event },
    /// R1: a job was released of a DAG that was paused or closed.
    WhileOff { event: Event },
    /// R1: a sporadic job's release is less than one minimum inter-arrival time after
    /// the one before it, or before the offset.
    TooSoon {
        dag: DagId,
        job: u64,
        release_ns: u64,
        earliest_ns: u64,
    },
    /// R1: a job was released after a later one.
    OutOfOrder { event: Event, later: u64 },
    /// The overrun policy: a job was released while as many were in flight as may be.
    TooMany { event: Event, in_flight: u32 },
    /// R1 and the overrun policy, where times are exact: the release was carried out at
    /// another time than the nominal one, or, if it was queued, the end of an older job.
    Unpunctual {
        event: Event,
        expected_ns: Option<u64>,
    },
    /// R1 and R4: what happens to a job once happened again, or after what excludes it.
    Again {
        event: Event,
        before: What,
        before_ns: u64,
    },
    /// R2: an instance was ready, or started, before another one was over.
    BeforeJoin {
        event: Event,
        awaited: Instance,
        /// When and where that was over; `None` if it was not over yet.
        over: Option<(u64, CoreId)>,
    },
    /// R3: an instance became ready in a step that nothing brought about that it waits
    /// for. R4: the same for a job's completion and its instances.
    OutOfStep {
        event: Event,
        last_ns: u64,
        last_core: CoreId,
    },
    /// R3: an instance became ready too late. R4: a job was complete, or missed, too
    /// late.
    Late { event: Event, since_ns: u64 },
    /// R3: an instance never became ready.
    NeverReady {
        instance: Instance,
        since_ns: u64,
        core: CoreId,
    },
    /// R4: a job was completed before one of its instances was over.
    BeforeItsEnd {
        event: Event,
        awaited: Instance,
        over_ns: Option<u64>,
    },
    /// R4: a job is not completed.
    NeverCompleted {
        dag: DagId,
        job: u64,
        /// When its last instance was over; `None`: one is not.
        over_ns: Option<u64>,
        /// The end of the events.
        end_ns: u64,
    },
    /// R4: a deadline was missed before it had passed.
    MissedEarly { event: Event, deadline_ns: u64 },
    /// R4: a job was missed that finished in time.
    MissedInTime {
        event: Event,
        finish_ns: u64,
        deadline_ns: u64,
    },
    /// R4: a job was not missed that finished late, or not at all.
    NotMissed {
        dag: DagId,
        job: u64,
        finish_ns: Option<u64>,
        deadline_ns: u64,
        /// When that was clear.
        at_ns: u64,
    },
    /// One life: what happened to an instance does not follow from what it was.
    OutOfTurn { event: Event, stage: Stage },
    /// One life: it happened before what comes before it.
    Backwards {
        event: Event,
        before: What,
        before_ns: u64,
    },
    /// One life: an instance was cancelled of a job that nothing had cut.
    CancelledUncut { event: Event },
    /// D1: a DAG went on after a fault that it does not survive.
    FaultBeyondLimit { event: Event },
    /// One core: an instance began on a core that still ran another one.
    CoreNotFree { event: Event, occupant: Instance },
    /// R5: an instance waited although a core was idle, or ran an instance that it
    /// outranks and could have replaced.
    PassedOver(Wrong),
    /// R5: an instance was on a core that is not its cluster's.
    OutsideItsCluster { event: Event },
    /// R5: an instance that keeps its core lost it.
    LostItsCore { event: Event },
}

impl Violation {
    /// Returns the rule that is broken.
    #[must_use]
    pub const fn rule(&self) -> Rule {
        match self {
            Self::BeforeRelease { .. }
            | Self::BeforeReleased { .. }
            | Self::NotReleased { .. }
            | Self::NotDue { .. }
            | Self::WhileOff { .. }
            | Self::TooSoon { .. }
            | Self::OutOfOrder { .. }
            | Self::TooMany { .. }
            | Self::Unpunctual { .. } => Rule::Release,
            Self::Again { event, .. } => match event.what {
                What::Released | What::Queued | What::Skipped => Rule::Release,
                _ => Rule::JobCompletion,
            },
            Self::BeforeJoin { .. } => Rule::AndJoin,
            Self::OutOfStep { event, .. } | Self::Late { event, .. } => match event.what {
                What::Ready => Rule::CompletionBoundary,
                _ => Rule::JobCompletion,
            },
            Self::NeverReady { .. } => Rule::CompletionBoundary,
            Self::BeforeItsEnd { .. }
            | Self::NeverCompleted { .. }
            | Self::MissedEarly { .. }
            | Self::MissedInTime { .. }
            | Self::NotMissed { .. } => Rule::JobCompletion,
            Self::OutOfTurn { .. }
            | Self::Backwards { .. }
            | Self::CancelledUncut { .. }
            | Self::FaultBeyondLimit { .. } => Rule::OneLife,
            Self::CoreNotFree { .. } => Rule::OneCore,
            Self::PassedOver(_) | Self::OutsideItsCluster { .. } | Self::LostItsCore { .. } => {
                Rule::Dispatch
            }
        }
    }

    /// Returns when it shows, in nanoseconds from the run's epoch.
    #[must_use]
    pub const fn time_ns(&self) -> u64 {
        match *self {
            Self::BeforeRelease { event, .. }
            | Self::BeforeReleased { event, .. }
            | Self::NotReleased { event, .. }
            | Self::NotDue { event }
            | Self::WhileOff { event }
            | Self::OutOfOrder { event, .. }
            | Self::TooMany { event, .. }
            | Self::Unpunctual { event, .. }
            | Self::Again { event, .. }
            | Self::BeforeJoin { event, .. }
            | Self::OutOfStep { event, .. }
            | Self::Late { event, .. }
            | Self::BeforeItsEnd { event, .. }
            | Self::MissedEarly { event, .. }
            | Self::MissedInTime { event, .. }
            | Self::OutOfTurn { event, .. }
            | Self::Backwards { event, .. }
            | Self::CancelledUncut { event }
            | Self::FaultBeyondLimit { event }
            | Self::CoreNotFree { event, .. }
            | Self::OutsideItsCluster { event }
            | Self::LostItsCore { event } => event.time_ns,
            Self::TooSoon { release_ns, .. } => release_ns,
            Self::NeverReady { since_ns, .. } => since_ns,
            Self::NeverCompleted {
                over_ns: Some(over_ns),
                ..
            } => over_ns,
            Self::NeverCompleted { end_ns, .. } => end_ns,
            Self::NotMissed { at_ns, .. } => at_ns,
            Self::PassedOver(Wrong::Waits { since_ns, .. }) => since_ns,
            Self::PassedOver(Wrong::OutOfTurn { at_ns, .. }) => at_ns,
        }
    }
}
