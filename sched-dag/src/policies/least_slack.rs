//! The least slack at the release: the earliest latest start first.
//!
//! If a subtask starts later than its deadline less the longest path from it, itself included, the
//! job is late whatever follows. Unlike the laxity of LLF, the slack is fixed at the release.
//! Without WCETs the policy is EDF.

use alloc::vec::Vec;

use super::PolicyRule;
use crate::task_set::Dag;

pub(super) const RULE: PolicyRule = PolicyRule {
    word: "slack",
    numbers: latest_starts,
    adds_release: true,
    reads_priorities: false,
};

fn latest_starts(dag: &Dag) -> Vec<u64> {
    let mut starts = alloc::vec![0; dag.subtasks().len()];
    for &subtask in dag.topological_order().iter().rev() {
        let (own, later) = (dag.subtask(subtask), dag.successors(subtask).iter());
        let end = later.map(|next| starts[next.index()]);
        let end = end.fold(own.relative_deadline_ns(), u64::min);
        starts[subtask.index()] = end.saturating_sub(own.wcet_ns().unwrap_or(0));
    }
    starts
}
