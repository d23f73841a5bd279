//! Earliest absolute deadline first: the deadline of the most urgent following sink.

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
