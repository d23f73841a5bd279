//! The attributes of a subtask: what the scheduler may need besides its edges.

use alloc::string::String;
use core::time::Duration;

/// What an app states about a subtask beyond its function and its topics.
///
/// The paper leaves these to the scheduling algorithm; all of them are optional
/// here, and the commit says when the chosen policy needs one that is missing.
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::SubtaskAttributes;
///
/// let attributes = SubtaskAttributes::named("fuse")
///     .priority(3)
///     .wcet(Duration::from_micros(500))
///     .non_preemptive();
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[must_use = "attributes have no effect until they are registered with a subtask"]
pub struct SubtaskAttributes {
    pub(crate) name: String,
    pub(crate) priority: Option<u32>,
    pub(crate) wcet: Option<Duration>,
    pub(crate) budget: Option<Duration>,
    pub(crate) stack_bytes: Option<u64>,
    pub(crate) non_preemptive: bool,
}

impl SubtaskAttributes {
    /// Starts with a name, by which reports and error messages call the subtask.
    ///
    /// Names are unique within a DAG. Without a name
    /// ([`default`](Self::default)) messages say `subtask 2`, counting from 0
    /// in the order of registration.
    ///
    /// ```
    /// let attributes = fass::SubtaskAttributes::named("fuse");
    /// ```
    pub fn named(name: &str) -> Self {
        Self {
            name: name.into(),
            ..Self::default()
        }
    }

    /// Sets the static priority; the *smaller* number is the higher priority.
    ///
    /// Used under [`Policy::StaticPriority`](crate::Policy::StaticPriority).
    /// Without it the commit derives one from the graph.
    ///
    /// ```
    /// let urgent = fass::SubtaskAttributes::named("brake").priority(0);
    /// ```
    pub fn priority(mut self, priority: u32) -> Self {
        self.priority = Some(priority);
        self
    }

    /// Sets the worst-case execution time: the longest that one instance
    /// executes, preemption not counted.
    ///
    /// At most `u64::MAX` nanoseconds; a longer one is a fault at commit.
    ///
    /// ```
    /// use core::time::Duration;
    /// let attributes = fass::SubtaskAttributes::named("fuse").wcet(Duration::from_millis(2));
    /// ```
    pub fn wcet(mut self, wcet: Duration) -> Self {
        self.wcet = Some(wcet);
        self
    }

    /// Sets the execution budget: an instance that executes longer, preemption
    /// not counted, is ended by the platform as a fault, and its DAG with it.
    ///
    /// Without it the platform may enforce a multiple of the
    /// [WCET](Self::wcet). At most `u64::MAX` nanoseconds; a longer one is a
    /// fault at commit. Virtual time does not enforce budgets.
    ///
    /// ```
    /// use core::time::Duration;
    /// let attributes = fass::SubtaskAttributes::named("plan").budget(Duration::from_millis(5));
    /// ```
    pub fn budget(mut self, budget: Duration) -> Self {
        self.budget = Some(budget);
        self
    }

    /// Sets the stack that the subtask needs, in bytes, from 16 KiB to 1 MiB; another number is
    /// a fault at commit. Without it the kernel gives 64 KiB. The stacks of a commit are all as
    /// large as the largest; `measure=stacks` says how much of them each subtask uses.
    ///
    /// ```
    /// let attributes = fass::SubtaskAttributes::named("plan").stack_bytes(256 << 10);
    /// ```
    pub fn stack_bytes(mut self, bytes: u64) -> Self {
        self.stack_bytes = Some(bytes);
        self
    }

    /// States that a started instance keeps its core until it finishes, although the
    /// platform preempts others.
    ///
    /// ```
    /// let attributes = fass::SubtaskAttributes::named("log").non_preemptive();
    /// ```
    pub fn non_preemptive(mut self) -> Self {
        self.non_preemptive = true;
        self
    }
}
