//! Which DAG may delay which: the relation that the policy makes between DAGs.
//!
//! It depends on the policy, on the priorities and on which subtasks can be preempted, not on
//! any execution time; so it is known also for DAGs that cannot be analysed. A DAG *outranks*
//! another if an instance of it may win a core over one of the other's, and *delays* it also
//! where it merely keeps a core. `judge` says why each case is sound.

use alloc::vec::Vec;

use crate::policy::{Policy, Preemption};
use crate::task_set::Dag;

/// The relation between the DAGs of a commit, by their positions.
#[derive(Clone, Debug)]
pub(super) struct RankRelation {
    policy: Policy,
    pub(super) preemption: PreemptionMix,
    /// Per DAG the most and the least urgent priority, as numbers.
    priorities: Vec<(u32, u32)>,
    /// Whether subtasks of one job may have different deadlines, under EDF.
    pub(super) ranks_sinks: bool,
}

/// Which subtasks can be preempted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PreemptionMix {
    All,
    None,
    Some,
}

impl RankRelation {
    /// Makes the relation between those that are at the positions `own`.
    pub(super) fn new(dags: &[Dag], own: &[usize], policy: Policy, preemption: Preemption) -> Self {
        let has_sink_deadlines =
            |&dag: &usize| dags[dag].least_deadline_ns() != dags[dag].relative_deadline_ns();
        Self {
            policy,
            preemption: mixture(dags, own, preemption),
            priorities: dags.iter().map(priority_range).collect(),
            ranks_sinks: policy == Policy::Edf && own.iter().any(has_sink_deadlines),
        }
    }

    /// Returns the relation between some of the DAGs, by their positions among
    /// these. The others still are on the machine: what can be preempted stays.
    pub(super) fn among(&self, members: &[usize]) -> Self {
        Self {
            priorities: members.iter().map(|&dag| self.priorities[dag]).collect(),
            ..*self
        }
    }

    /// Reports whether an instance of `other` may win a core that an instance
    /// of `dag` waits for.
    pub(super) fn may_outrank(&self, other: usize, dag: usize) -> bool {
        other != dag
            && match (self.policy, self.preemption) {
                (Policy::Edf, _) | (_, PreemptionMix::Some) => true,
                (Policy::StaticPriority, _) => self.ranks(other)[0] < self.ranks(dag)[1],
            }
    }

    /// Reports whether `dag` may have to wait for `other`, be it only because
    /// an instance of `other` keeps its core.
    pub(super) fn may_delay(&self, other: usize, dag: usize) -> bool {
        other != dag && (self.preemption != PreemptionMix::All || self.may_outrank(other, dag))
    }

    /// Reports whether of two DAGs each may outrank the other.
    pub(super) fn interleaves(&self) -> bool {
        let all = 0..self.priorities.len();
        let both = |a: usize, b: usize| self.may_outrank(a, b) && self.may_outrank(b, a);
        all.clone().any(|a| all.clone().any(|b| both(a, b)))
    }

    /// Returns the most and the least urgent priority of a DAG among all; the smaller wins.
    pub(super) fn ranks(&self, dag: usize) -> [(u32, usize); 2] {
        let (most, least) = self.priorities[dag];
        [(most, dag), (least, dag)]
    }

    /// Reports whether a younger job of a DAG may win over an older one.
    pub(super) fn younger_may_win(&self, dag: usize) -> bool {
        let (most, least) = self.priorities[dag];
        let unequal = match self.policy {
            Policy::StaticPriority => most != least,
            // It may have a subtask that leads to a more urgent sink.
            Policy::Edf => self.ranks_sinks,
        };
        unequal || self.preemption != PreemptionMix::All
    }
}

fn priority_range(dag: &Dag) -> (u32, u32) {
    let numbers = || dag.subtasks().iter().map(|subtask| subtask.priority().0);
    (numbers().min().unwrap_or(0), numbers().max().unwrap_or(0))
}

fn mixture(dags: &[Dag], own: &[usize], preemption: Preemption) -> PreemptionMix {
    let mut subtasks = own.iter().flat_map(|&dag| dags[dag].subtasks());
    let keeps = |non_preemptive: bool| non_preemptive || preemption == Preemption::Disabled;
    let Some(first) = subtasks
        .next()
        .map(|first| keeps(first.is_non_preemptive()))
    else {
        return PreemptionMix::All;
    };
    if subtasks.any(|other| keeps(other.is_non_preemptive()) != first) {
        PreemptionMix::Some
    } else if first {
        PreemptionMix::None
    } else {
        PreemptionMix::All
    }
}
