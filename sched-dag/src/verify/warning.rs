//! What a commit accepts and its author may not have meant.

use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

use super::fault_text::list;
use super::label::{DagLabel, SubtaskLabel};
use crate::policy::Priority;

/// One oddity that does not prevent scheduling.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the fields' names are the words of the model")]
pub enum Warning {
    /// A WCET of 0, on which no bound can rest.
    ZeroWcet {
        dag: DagLabel,
        subtask: SubtaskLabel,
    },
    /// Under static priority: subtasks with the same priority, so that the
    /// order of registration decides.
    EqualPriorities {
        priority: Priority,
        subtasks: Vec<(DagLabel, SubtaskLabel)>,
    },
    /// A sink writes a topic that no subtask reads.
    UnreadSinkValue {
        dag: DagLabel,
        subtask: SubtaskLabel,
        topic: String,
    },
    /// Two DAGs with one name.
    DuplicateDagName { first: DagLabel, second: DagLabel },
    /// The analysis is certain that the DAG cannot keep its deadlines when
    /// every instance takes its WCET. Not from [`verify`](crate::verify()), which
    /// does not analyse, but from a caller that does.
    CertainMiss {
        dag: DagLabel,
        /// Why, in words, with the remedy.
        reason: String,
    },
}

impl Warning {
    /// Returns the kind of warning as a stable word in snake case.
    #[must_use]
    pub const fn code(&self) -> &'static str {
        match self {
            Self::ZeroWcet { .. } => "zero_wcet",
            Self::EqualPriorities { .. } => "equal_priorities",
            Self::UnreadSinkValue { .. } => "unread_sink_value",
            Self::DuplicateDagName { .. } => "duplicate_dag_name",
            Self::CertainMiss { .. } => "certain_miss",
        }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ZeroWcet { dag, subtask } => write!(
                f,
                "{subtask} of {dag} has a WCET of 0 ns; measure it, or leave the WCET out"
            ),
            Self::EqualPriorities { priority, subtasks } => {
                let named: Vec<Member<'_>> = subtasks.iter().map(Member).collect();
                write!(
                    f,
                    "priority {} is given {} times: to {}; the order of registration decides between them",
                    priority.0,
                    subtasks.len(),
                    list(&named)
                )
            }
            Self::UnreadSinkValue {
                dag,
                subtask,
                topic,
            } => write!(
                f,
                "{subtask}, a sink of {dag}, writes topic `{topic}`, which no subtask reads; drop the output"
            ),
            Self::DuplicateDagName { first, second } => write!(
                f,
                "two DAGs are named `{}` (number {} and {}); rename one",
                first.name, first.id.0, second.id.0
            ),
            Self::CertainMiss { dag, reason } => {
                write!(f, "{dag} cannot keep its deadlines at its WCETs: {reason}")
            }
        }
    }
}

/// A subtask together with its DAG, as a list names it.
struct Member<'a>(&'a (DagLabel, SubtaskLabel));

impl fmt::Display for Member<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (dag, subtask) = self.0;
        write!(f, "{subtask} of {dag}")
    }
}
