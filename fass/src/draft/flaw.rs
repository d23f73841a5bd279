//! What a registration can get wrong, as the draft keeps it for the commit.
//!
//! A draft does not know its DAG's number, so a flaw names no DAG; the commit makes a
//! [`Fault`](crate::Fault) of it, which does and which has the words.

use sched_dag::SubtaskLabel;

/// A mistake in one registration. The fields are those of the fault of that name.
#[derive(Clone, Debug)]
pub(crate) enum Flaw {
    InputArity {
        subtask: SubtaskLabel,
        expected: usize,
        given: usize,
    },
    OutputArity {
        subtask: SubtaskLabel,
        expected: usize,
        given: usize,
    },
    DurationTooLong {
        subtask: Option<SubtaskLabel>,
        what: &'static str,
    },
    PeriodsDiffer {
        subtask: SubtaskLabel,
        first_ns: u64,
        second_ns: u64,
    },
    ActivationsDiffer {
        subtask: SubtaskLabel,
    },
}
