//! The changes that can be asked of a run. [`lifecycle`](crate::lifecycle) has the rules.

use crate::ids::{DagId, Instance, ModeId};

/// A change that is asked of a run: by a function, with effect from its completion on, by another
/// cluster, or from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// A sporadic DAG gets a signal.
    Signal(DagId),
    /// A DAG releases no jobs until it is resumed.
    Pause(DagId),
    /// A paused DAG releases jobs again.
    Resume(DagId),
    /// A DAG releases no further job, and what is in flight goes on. Asked from outside only.
    Close(DagId),
    /// A DAG is ended: nothing of it starts any more. Asked from outside only.
    End(DagId),
    /// Another set of DAGs runs.
    Enter(ModeId, ModeEntry),
    /// The run ends: no DAG releases a further job.
    ShutDown,
    /// The run begins. No function asks for that, but a driver, before all else.
    Begin,
    /// Waiting requests may take effect. A driver asks for that in each step until they have,
    /// before all else.
    GoOn,
    /// A wait has its answer.
    Answer(WaitId),
    /// Nothing but a step. An engine asks for that, lest a completion take the short way.
    Step,
}

impl Request {
    /// Reports whether what it comes to is for a [`Lifecycle`](crate::lifecycle::Lifecycle) to say,
    /// where there is one.
    pub const fn is_of_lifecycle(self) -> bool {
        !matches!(
            self,
            Self::Signal(_) | Self::Close(_) | Self::End(_) | Self::Answer(_) | Self::Step
        )
    }
}

/// A wait of an instance. No two waits of a run have the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WaitId {
    /// The instance that waits.
    pub instance: Instance,
    /// The number of the wait among those of the instance, from 0 on.
    pub number: u32,
}

/// The longest time that a wait takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaitLimit {
    /// So many nanoseconds.
    For(u64),
    /// Until so many nanoseconds after the release of the job; none if that is past.
    SinceRelease(u64),
}

/// When a mode is entered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModeEntry {
    /// At the instant of the request (M2).
    AtOnce,
    /// When nothing is in flight of the DAGs that leave (M3).
    WhenIdle,
}
