//! Specifications of DAGs as stated by an app, before any verification.
//!
//! Any part of a spec may be wrong; the verification finds out. Times are in nanoseconds from the
//! start of scheduling.

use alloc::string::String;
use alloc::vec::Vec;
use core::any::TypeId;
use core::ops::RangeInclusive;

use crate::ids::ClusterId;
use crate::policy::{Activation, OnFault, OverrunPolicy, Priority};

/// A DAG task as described by its app.
#[derive(Clone, Debug, Default)]
pub struct DagSpec {
    /// The name used in messages; may be empty, then messages say `dag 0`.
    pub name: String,
    /// The source of the releases.
    pub activation: Activation,
    /// The time between two nominal releases; for a sporadic DAG the least time. `None` if no
    /// source states a period.
    pub period_ns: Option<u64>,
    /// The time after a release by which all sinks shall have finished.
    pub relative_deadline_ns: Option<u64>,
    /// The time of the first nominal release; for a sporadic DAG the earliest possible time.
    pub offset_ns: u64,
    /// The most jobs that may be in flight. `None`: enough for the deadline, `ceil(D / T)` jobs and
    /// one more; only one if subtasks share a state.
    pub in_flight: Option<u32>,
    /// The policy for a release beyond `in_flight`.
    pub overrun: OverrunPolicy,
    /// The cost of a fault of an instance.
    pub on_fault: OnFault,
    /// The cluster whose cores run the DAG; `None` if cores are not divided.
    pub cluster: Option<ClusterId>,
    /// The cores of its cluster allowed to execute the DAG, counted from 0; empty: all. DAGs of a
    /// cluster have the same cores, or none in common. A DAG with a list of a core has no affinity.
    pub affinity: Vec<u32>,
    /// The number of jobs to release; `None`: without end.
    pub jobs: Option<u64>,
    /// The subtasks in the order of their registration.
    pub subtasks: Vec<SubtaskSpec>,
    /// Precedence edges `(predecessor, successor)` by position in `subtasks`, besides the edges
    /// that follow from topics.
    pub edges: Vec<(usize, usize)>,
    /// The states shared by subtasks, from job to job.
    pub states: Vec<StateSpec>,
    /// Topics whose latest value is read by subtasks of any DAG.
    pub latest: Vec<LatestSpec>,
    /// The locks used by its subtasks.
    pub locks: Vec<LockUse>,
}

impl DagSpec {
    /// Returns the most jobs in flight: the stated number or enough for the deadline, but no more
    /// than the limit of jobs.
    ///
    /// A job that meets its deadline is in flight for at most D, so at most ceil(D / T) such jobs
    /// are in flight at any time. With one more, a late job can end while the next is released.
    /// Where subtasks share a state, jobs take turns: without a stated number, only one is in
    /// flight.
    pub fn most_in_flight(&self) -> u64 {
        let jobs = self.jobs.unwrap_or(u64::MAX);
        if let Some(given) = self.in_flight {
            return u64::from(given).min(jobs);
        }
        if self.states.iter().any(StateSpec::is_shared) {
            return 1;
        }
        let (Some(period_ns), Some(deadline_ns)) = (self.period_ns, self.relative_deadline_ns)
        else {
            return 1;
        };
        // A period of 0 is reported as a fault of its own; the other checks need a number to go on
        // with.
        if period_ns == 0 {
            return 1;
        }
        let enough = deadline_ns.div_ceil(period_ns).saturating_add(1);
        enough.min(jobs)
    }
}

/// A state shared by subtasks of one DAG, as described by its app.
///
/// Two users of a state do not run at the same time unless both only read. The verification orders
/// the users, and adds precedence edges between users that may not overlap. It also allows only one
/// job in flight, so that jobs keep the order, too.
#[derive(Clone, Debug, Default)]
pub struct StateSpec {
    /// The name used in messages.
    pub name: String,
    /// The users of the state, each subtask once, in any order.
    pub users: Vec<StateUser>,
}

impl StateSpec {
    /// Reports whether several subtasks use the state; a single user is in order by itself.
    pub(crate) fn is_shared(&self) -> bool {
        let first = self.users.first();
        first.is_some_and(|first| self.users.iter().any(|user| user.subtask != first.subtask))
    }
}

/// A subtask's use of a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StateUser {
    /// The subtask by position in `subtasks`.
    pub subtask: usize,
    /// Whether the subtask changes the state rather than only reads it.
    pub updates: bool,
}

/// A subtask's use of a lock. Each instance enters some *sections*; sections of the same lock
/// exclude each other, on all cores. An instance in a section is not preempted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LockUse {
    /// The subtask by position in `subtasks`.
    pub subtask: usize,
    /// The lock's name; equal names mean the same lock.
    pub lock: String,
    /// An upper bound on the time of a section in nanoseconds; `None`: none has been stated.
    pub longest_ns: Option<u64>,
    /// The most sections entered by one instance.
    pub sections: u32,
    /// Whether the commit contains another use of the lock; the verification finds out.
    pub is_shared: bool,
}

impl LockUse {
    /// Returns the longest wait for a section, in nanoseconds, on a machine of so many cores, which
    /// take turns.
    pub(crate) fn longest_wait_ns(&self, cores: u32) -> u64 {
        let others = u64::from(cores.saturating_sub(1)) * u64::from(self.is_shared);
        self.longest_ns.unwrap_or(u64::MAX).saturating_mul(others)
    }
}

/// A topic whose latest complete value is read by subtasks without waiting. No edge follows from
/// it.
#[derive(Clone, Debug)]
pub struct LatestSpec {
    /// The topic, with the type expected by the readers.
    pub port: TopicPort,
    /// The number of subtasks, of any DAG, reading the topic this way.
    pub samplers: usize,
}

/// The allowed stack sizes of a subtask, in bytes.
pub const STACK_BYTES: RangeInclusive<u64> = 16 << 10..=1 << 20;

/// A subtask as described by its app.
#[derive(Clone, Debug, Default)]
pub struct SubtaskSpec {
    /// The name used in messages; may be empty, then messages say `subtask 0`.
    pub name: String,
    /// The worst-case execution time, if known: the sum over the segments, if the subtask waits.
    pub wcet_ns: Option<u64>,
    /// The waits, in order: between n waits there are n + 1 segments.
    pub waits: Vec<Wait>,
    /// The margin of the WCET over the longest observed call, in percent of the observed time;
    /// `None`: the WCET is stated.
    pub wcet_margin_percent: Option<u32>,
    /// The execution time after which an instance is ended as faulty, in nanoseconds; `None`: the
    /// driver's choice. Enforced by the driver, not by the scheduler.
    pub budget_ns: Option<u64>,
    /// The stack the subtask needs, in bytes, within [`STACK_BYTES`]; `None`: the driver's choice.
    pub stack_bytes: Option<u64>,
    /// The static priority; `None`: derived from the graph.
    pub priority: Option<Priority>,
    /// Whether a started instance keeps its core although preemption is on.
    pub non_preemptive: bool,
    /// For a sink, the time after a release by which the sink shall have finished; `None`: the
    /// DAG's deadline.
    pub relative_deadline_ns: Option<u64>,
    /// The ports of the arguments, in order.
    pub inputs: Vec<TopicPort>,
    /// The ports of the return values, in order.
    pub outputs: Vec<TopicPort>,
}

/// The most waits a subtask may state.
pub const MOST_WAITS: usize = 254;

/// A wait of a subtask, taken once by each instance, and the segment after the wait.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wait {
    /// The time after which the wait ends without an answer, in nanoseconds; 0 is allowed.
    pub limit_ns: u64,
    /// The worst-case execution time of the segment after the wait, if known: a part of
    /// [`SubtaskSpec::wcet_ns`].
    pub segment_ns: Option<u64>,
}

/// One end of a topic at a subtask: a typed, named edge bundle.
#[derive(Clone, Debug)]
pub struct TopicPort {
    /// The topic's name.
    pub topic: String,
    /// The identity of the message's type.
    pub type_id: TypeId,
    /// The name of the message's type, for use in messages.
    pub type_name: &'static str,
    /// Whether several readers of the topic are possible: the message can be cloned or shared,
    /// rather than only moved.
    pub can_fan_out: bool,
}
