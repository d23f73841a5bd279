//! The choices that govern scheduling: policy, preemption, priority, overrun.

/// How the ready instances are ordered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Policy {
    /// By the subtask's [`Priority`], the same for every job.
    StaticPriority,
    /// By the job's absolute deadline, the earliest first.
    Edf,
}

/// Whether a started instance may lose its core.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Preemption {
    /// At every instant the instances with the smallest keys run.
    Enabled,
    /// A started instance keeps its core until it finishes.
    Disabled,
}

/// The urgency of a subtask under [`Policy::StaticPriority`].
///
/// The smaller number is the *higher* priority. There is no `Ord`, because
/// `a < b` would read as the opposite of what it means; ask
/// [`is_higher_than`](Self::is_higher_than).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Priority(pub u32);

impl Priority {
    /// Reports whether this priority wins over `other`.
    #[must_use]
    pub const fn is_higher_than(self, other: Self) -> bool {
        self.0 < other.0
    }
}

/// What happens at a release that finds as many jobs in flight as the DAG may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum OverrunPolicy {
    /// The release waits until the oldest job is complete; its nominal release
    /// time, and so its deadline, stay what they are.
    #[default]
    Queue,
    /// The release does not happen and is counted.
    Skip,
    /// The oldest job ends at its next subtask boundary and makes room.
    Abort,
}
