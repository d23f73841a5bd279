//! First in, first out: the job with the earliest release goes first.

use super::PolicyRule;

pub(super) const RULE: PolicyRule = PolicyRule {
    word: "fifo",
    numbers: |dag| alloc::vec![0; dag.subtasks().len()],
    adds_release: true,
    reads_priorities: false,
};
