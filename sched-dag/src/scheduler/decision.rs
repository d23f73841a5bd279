//! What a dispatch tells the driver to do.

use crate::ids::{CoreId, Instance};

/// One change of what a core executes.
///
/// A dispatch lists only changes: a core that it does not name goes on with
/// what it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[must_use]
pub enum Decision {
    /// The core, idle or just preempted, begins the instance.
    Start {
        /// The core.
        core: CoreId,
        /// The instance, which has not run before.
        instance: Instance,
    },
    /// The core, idle or just preempted, continues the instance.
    Resume {
        /// The core, not necessarily that on which the instance ran before.
        core: CoreId,
        /// The instance, which was preempted before.
        instance: Instance,
    },
    /// The core gives up the instance, which keeps its progress. The next
    /// decision of the dispatch starts or resumes another one on the core.
    Preempt {
        /// The core.
        core: CoreId,
        /// The instance that has to wait.
        instance: Instance,
    },
}

impl Decision {
    /// Returns the core that the decision is for.
    #[must_use]
    #[inline]
    pub const fn core(self) -> CoreId {
        match self {
            Self::Start { core, .. } | Self::Resume { core, .. } | Self::Preempt { core, .. } => {
                core
            }
        }
    }

    /// Returns the instance that the decision is about.
    #[must_use]
    #[inline]
    pub const fn instance(self) -> Instance {
        match self {
            Self::Start { instance, .. }
            | Self::Resume { instance, .. }
            | Self::Preempt { instance, .. } => instance,
        }
    }
}
