//! The earliest absolute deadline first: that of the most urgent sink that follows.

use super::PolicyRule;

pub(super) const RULE: PolicyRule = PolicyRule {
    word: "edf",
    numbers: |dag| {
        let subtasks = dag.subtasks().iter();
        subtasks.map(|of| of.relative_deadline_ns()).collect()
    },
    adds_release: true,
    reads_priorities: false,
};
