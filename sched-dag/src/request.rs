//! Requests for changes of a run. [`lifecycle`](crate::lifecycle) has the rules.

use crate::ids::{DagId, Instance, ModeId};

/// A requested change of a run: by a function, with effect from its completion on, by another
/// cluster, or from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// A sporadic DAG gets a signal.
    Signal(DagId),
    /// A DAG releases no jobs until it is resumed.
    Pause(DagId),
    /// A paused DAG releases jobs again.
    Resume(DagId),
    /// A DAG releases no further job, and jobs in flight go on. Requested from outside only.
    Close(DagId),
    /// A DAG is ended: nothing of it starts any more. Requested from outside only.
    End(DagId),
    /// Another set of DAGs runs.
    Enter(ModeId, ModeEntry),
    /// The run ends: no DAG releases a further job, except DAGs with recorded inputs (L6).
    ShutDown,
    /// The run begins. Not for functions: a driver makes the request, before any other request.
    Begin,
    /// Waiting requests may take effect. A driver makes the request in each step until they have
    /// taken effect, before any other request.
    GoOn,
    /// A wait has its answer.
    Answer(WaitId),
    /// Nothing but a step. An engine makes the request to keep a completion from taking the short
    /// way.
    Step,
}

impl Request {
    /// Reports whether the effect is for a [`Lifecycle`](crate::lifecycle::Lifecycle) to decide,
    /// where there is one.
    pub const fn is_of_lifecycle(self) -> bool {
        !matches!(
            self,
            Self::Signal(_) | Self::Close(_) | Self::End(_) | Self::Answer(_) | Self::Step
        )
    }
}

/// A wait of an instance. No two waits of a run have equal ids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WaitId {
    /// The waiting instance.
    pub instance: Instance,
    /// The number of the wait among the waits of the instance, from 0 on.
    pub number: u32,
}

/// The limit of a wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaitLimit {
    /// So many nanoseconds.
    For(u64),
    /// Until so many nanoseconds after the release of the job; no wait if that is past.
    SinceRelease(u64),
}

/// The time at which a mode is entered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModeEntry {
    /// At the instant of the request (M2).
    AtOnce,
    /// When nothing of the leaving DAGs is in flight (M3).
    WhenIdle,
}
