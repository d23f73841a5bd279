//! Oddities of a commit that its author may not have meant, and that prevent nothing.

use alloc::string::String;
use alloc::vec::Vec;

use super::label::{DagLabel, SubtaskLabel};
use super::phrases::{list, members};
use crate::policy::Priority;
use crate::worded;

worded! {
    /// One oddity that does not prevent scheduling.
    pub enum Warning {
        /// A WCET of 0, on which no bound can rest.
        ZeroWcet { dag: DagLabel, subtask: SubtaskLabel } = "zero_wcet",
            "{subtask} of {dag} has a WCET of 0 ns; measure it, or leave the WCET out";
        /// Under static priority: subtasks with the same priority, so that the
        /// order of registration decides.
        EqualPriorities { priority: Priority, subtasks: Vec<(DagLabel, SubtaskLabel)> } =
            "equal_priorities",
            "priority {} is given {} times: to {}; the order of registration decides between them",
            priority.0, subtasks.len(), list(&members(subtasks));
        /// A sink writes a topic that no subtask reads.
        UnreadSinkValue { dag: DagLabel, subtask: SubtaskLabel, topic: String } =
            "unread_sink_value",
            "{subtask}, a sink of {dag}, writes topic `{topic}`, which no subtask reads; drop the \
             output";
        /// Two DAGs with one name.
        DuplicateDagName { first: DagLabel, second: DagLabel } = "duplicate_dag_name",
            "two DAGs are named `{}` (number {} and {}); rename one",
            first.name, first.id.0, second.id.0;
        /// The analysis is certain that the DAG cannot keep its deadlines when
        /// every instance takes its WCET; `reason` says why, with the remedy. Not
        /// from [`verify`](crate::verify()), which does not analyse, but from a
        /// caller that does.
        CertainMiss { dag: DagLabel, reason: String } = "certain_miss",
            "{dag} cannot keep its deadlines at its WCETs: {reason}";
    }
}
