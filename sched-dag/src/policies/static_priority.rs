//! Static priorities: the same order for every job.

use super::PolicyRule;

pub(super) const RULE: PolicyRule = PolicyRule {
    word: "static",
    numbers: |dag| {
        let subtasks = dag.subtasks().iter();
        subtasks.map(|of| of.priority().0.into()).collect()
    },
    adds_release: false,
    reads_priorities: true,
};
