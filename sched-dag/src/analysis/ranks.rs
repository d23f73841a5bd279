//! Which DAG may delay which: the policy's relation between DAGs.
//!
//! The relation depends on the policy's numbers and on the preemptibility of subtasks, not on any
//! execution time. So the relation is known even for DAGs that cannot be analysed. A DAG *outranks*
//! another if one of its instances may win a core over an instance of the other. A DAG *delays*
//! another also by merely keeping a core. `schedulability::multiple_paths` says why each case is
//! sound.

use alloc::vec::Vec;

use crate::policies::Policy;
use crate::policy::Preemption;
use crate::task_set::{Dag, Subtask};

/// The relation between the DAGs of a commit, by their positions.
#[derive(Clone, Debug)]
pub(super) struct RankRelation {
    pub(super) order: InstanceOrder,
    pub(super) preemption: PreemptionMix,
    /// By DAG, the policy's smallest and largest number.
    numbers: Vec<[u64; 2]>,
    /// Whether subtasks of one job may have different deadlines, and the order uses them.
    pub(super) ranks_sinks: bool,
}

/// The order of instances, as far as proofs know it, whatever the policy's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum InstanceOrder {
    /// By numbers equal for every job, like static priorities.
    Ranked,
    /// By absolute deadlines.
    ByDeadline,
    /// By anything else. Only the guarantees of any work-conserving order hold.
    Any,
}

/// Which subtasks can be preempted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PreemptionMix {
    All,
    None,
    Some,
}

impl RankRelation {
    /// Makes the relation between the DAGs at the positions `own`.
    pub(super) fn new(dags: &[Dag], own: &[usize], policy: Policy, preemption: Preemption) -> Self {
        let mut own_dags = own.iter().map(|&dag| &dags[dag]);
        let is_by_deadline = |dag: &Dag| {
            let deadlines_ns = dag.subtasks().iter().map(Subtask::relative_deadline_ns);
            deadlines_ns.eq(policy.numbers(dag))
        };
        let order = match policy.adds_release() {
            false => InstanceOrder::Ranked,
            true if own_dags.clone().all(is_by_deadline) => InstanceOrder::ByDeadline,
            true => InstanceOrder::Any,
        };
        let has_sink_deadlines = |dag: &Dag| dag.least_deadline_ns() != dag.relative_deadline_ns();
        let range = |dag| {
            let numbers = policy.numbers(dag);
            [numbers.iter().min(), numbers.iter().max()].map(|end| end.copied().unwrap_or(0))
        };
        Self {
            order,
            preemption: mixture(dags, own, preemption),
            numbers: dags.iter().map(range).collect(),
            ranks_sinks: order == InstanceOrder::ByDeadline && own_dags.any(has_sink_deadlines),
        }
    }

    /// Returns the relation between some of its DAGs, given by their positions in it. The other
    /// DAGs are still on the machine, so the preemption mix stays.
    pub(super) fn among(&self, members: &[usize]) -> Self {
        Self {
            numbers: members.iter().map(|&dag| self.numbers[dag]).collect(),
            ..*self
        }
    }

    /// Reports whether an instance of `other` may win a core for which an instance of `dag` waits.
    pub(super) fn may_outrank(&self, other: usize, dag: usize) -> bool {
        other != dag
            && (self.order != InstanceOrder::Ranked
                || self.preemption == PreemptionMix::Some
                || self.ranks(other)[0] < self.ranks(dag)[1])
    }

    /// Reports whether `dag` may have to wait for `other`, even if only because an instance of
    /// `other` keeps its core.
    pub(super) fn may_delay(&self, other: usize, dag: usize) -> bool {
        other != dag && (self.preemption != PreemptionMix::All || self.may_outrank(other, dag))
    }

    /// Reports whether some two DAGs may each outrank the other.
    pub(super) fn interleaves(&self) -> bool {
        let all = 0..self.numbers.len();
        let both = |a: usize, b: usize| self.may_outrank(a, b) && self.may_outrank(b, a);
        all.clone().any(|a| all.clone().any(|b| both(a, b)))
    }

    /// Returns the smallest and the largest number of a DAG, each with the DAG's position; the
    /// smaller pair wins.
    pub(super) fn ranks(&self, dag: usize) -> [(u64, usize); 2] {
        self.numbers[dag].map(|number| (number, dag))
    }

    /// Reports whether a younger job of a DAG may win over an older job.
    pub(super) fn younger_may_win(&self, dag: usize) -> bool {
        let unequal = match self.order {
            InstanceOrder::Ranked => self.numbers[dag][0] != self.numbers[dag][1],
            // The younger job may have a subtask on the way to a more urgent sink.
            InstanceOrder::ByDeadline => self.ranks_sinks,
            InstanceOrder::Any => true,
        };
        unequal || self.preemption != PreemptionMix::All
    }
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
