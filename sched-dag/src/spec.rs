//! Specifications of DAGs as an app states them, before anything has been verified.
//!
//! A spec may be wrong in every way; the verification finds out. Times are in
//! nanoseconds from the start of scheduling.

use alloc::string::String;
use alloc::vec::Vec;
use core::any::TypeId;
use core::ops::RangeInclusive;

use crate::ids::ClusterId;
use crate::policy::{Activation, OnFault, OverrunPolicy, Priority};

/// A DAG task as its app describes it.
#[derive(Clone, Debug, Default)]
pub struct DagSpec {
    /// The name that messages use; may be empty, then messages say `dag 0`.
    pub name: String,
    /// The source of the releases.
    pub activation: Activation,
    /// The time between two nominal releases, of a sporadic DAG the least time;
    /// `None` if no source states one.
    pub period_ns: Option<u64>,
    /// The time after a release by which all sinks shall have finished.
    pub relative_deadline_ns: Option<u64>,
    /// The time of the first nominal release, of a sporadic DAG the earliest one.
    pub offset_ns: u64,
    /// The most jobs that may be in flight; `None`: enough for the deadline,
    /// `ceil(D / T)` jobs and one more.
    pub in_flight: Option<u32>,
    /// The policy for a release beyond `in_flight`.
    pub overrun: OverrunPolicy,
    /// The cost of a fault of an instance.
    pub on_fault: OnFault,
    /// The cluster whose cores run it; `None` where they are not divided.
    pub cluster: Option<ClusterId>,
    /// The cores of its cluster that execute it, counted from 0; empty: all. DAGs of a cluster
    /// have the same ones, or none in common. A DAG with a list of a core has none.
    pub affinity: Vec<u32>,
    /// The number of jobs to release; `None`: without end.
    pub jobs: Option<u64>,
    /// The subtasks in the order of their registration.
    pub subtasks: Vec<SubtaskSpec>,
    /// Precedence edges `(predecessor, successor)` by position in `subtasks`,
    /// besides those that follow from topics.
    pub edges: Vec<(usize, usize)>,
    /// The states that subtasks share from job to job.
    pub states: Vec<StateSpec>,
    /// Topics whose latest value subtasks of any DAG read.
    pub latest: Vec<LatestSpec>,
    /// The locks whose sections its subtasks enter.
    pub locks: Vec<LockUse>,
}

impl DagSpec {
    /// Returns the most jobs in flight, given or enough for the deadline, and no more than there
    /// are.
    ///
    /// A job that meets its deadline is in flight for at most D, so at most
    /// ceil(D / T) of them are at any time; with one more a late job can end while
    /// the next one is released. Where subtasks share a state, jobs take turns.
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
        // A fault of its own; the other checks need a number to go on with.
        if period_ns == 0 {
            return 1;
        }
        let enough = deadline_ns.div_ceil(period_ns).saturating_add(1);
        enough.min(jobs)
    }
}

/// A state that subtasks of one DAG share, as its app describes it.
///
/// Its users do not run at the same time unless all of them only read. The
/// verification gives them an order and adds the precedence edges that keep it,
/// and allows one job in flight, so that jobs keep it, too.
#[derive(Clone, Debug, Default)]
pub struct StateSpec {
    /// The name that messages use.
    pub name: String,
    /// Its users, each subtask once, in any order.
    pub users: Vec<StateUser>,
}

impl StateSpec {
    /// Reports whether several subtasks use it; one alone is in order by itself.
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
    /// Whether it changes the state rather than only reads it.
    pub updates: bool,
}

/// A subtask's use of a lock: each instance enters some *sections*, of which those of one lock
/// exclude each other, on all cores. An instance in one is not preempted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LockUse {
    /// The subtask by position in `subtasks`.
    pub subtask: usize,
    /// The lock's name; those of one name count as one lock.
    pub lock: String,
    /// The time that no section of it exceeds; `None`: nobody has stated one.
    pub longest_ns: Option<u64>,
    /// The most sections that an instance enters.
    pub sections: u32,
    /// Whether there is another use of it in the commit; the verification finds out.
    pub is_shared: bool,
}

impl LockUse {
    /// Returns the longest wait for a section of it on a machine of so many cores, which take turns.
    pub(crate) fn turn_ns(&self, cores: u32) -> u64 {
        let others = u64::from(cores.saturating_sub(1)) * u64::from(self.is_shared);
        self.longest_ns.unwrap_or(u64::MAX).saturating_mul(others)
    }
}

/// A topic of which the latest complete value is read by subtasks that wait for
/// nothing. No edge follows from it.
#[derive(Clone, Debug)]
pub struct LatestSpec {
    /// The topic, with the type that the readers expect.
    pub port: TopicPort,
    /// The number of subtasks, of any DAG, that read it so.
    pub samplers: usize,
}

/// How large a subtask's stack may be.
pub const STACK_BYTES: RangeInclusive<u64> = 16 << 10..=1 << 20;

/// A subtask as its app describes it.
#[derive(Clone, Debug, Default)]
pub struct SubtaskSpec {
    /// The name that messages use; may be empty, then messages say `subtask 0`.
    pub name: String,
    /// The worst-case execution time, if known: the sum over its segments, if it waits.
    pub wcet_ns: Option<u64>,
    /// Its waits, in order: between n waits it has n + 1 segments.
    pub waits: Vec<Wait>,
    /// The margin that it has over the longest call observed, in hundredths of that;
    /// `None`: it is stated.
    pub wcet_margin_percent: Option<u32>,
    /// The execution time beyond which an instance is ended as faulty; `None`:
    /// the driver's choice. Enforced by the driver, not by the scheduler.
    pub budget_ns: Option<u64>,
    /// The stack that it needs, in bytes, of [`STACK_BYTES`]; `None`: the driver's choice.
    pub stack_bytes: Option<u64>,
    /// The static priority; `None`: derived from the graph.
    pub priority: Option<Priority>,
    /// Whether a started instance keeps its core although preemption is on.
    pub non_preemptive: bool,
    /// Of a sink, the time after a release by which it shall have finished; `None`:
    /// its DAG's.
    pub relative_deadline_ns: Option<u64>,
    /// One port an argument, in order.
    pub inputs: Vec<TopicPort>,
    /// One port a return value, in order.
    pub outputs: Vec<TopicPort>,
}

/// The most waits that a subtask may state.
pub const MOST_WAITS: usize = 254;

/// A wait of a subtask, which each of its instances takes once, and the segment that follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wait {
    /// The time after which it ends without an answer; 0 is allowed.
    pub limit_ns: u64,
    /// The worst-case execution time of the segment that follows, if known: a part of
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
    /// The name of the message's type, for messages.
    pub type_name: &'static str,
    /// Whether several readers of the topic are possible: the message can be
    /// cloned or shared, rather than only moved.
    pub can_fan_out: bool,
}
