//! What a registration can get wrong, as the draft keeps it for the commit.
//!
//! A draft does not know its DAG's number, so a flaw names no DAG; the commit makes a
//! [`Fault`](crate::Fault) of it, which does and which has the words.

use alloc::string::String;
use core::fmt;

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

/// A fault of several parts of a commit, in words: of [modes](crate::Modes), or of what enters.
///
/// ```
/// use fass::{Modes, SubtaskAttributes, create_dag, finish_create_dags};
///
/// # let machine = virtual_time::VirtualTime::new();
/// # let period = core::time::Duration::from_millis(10);
/// let lander = create_dag();
/// lander.name("lander").period(period).relative_deadline(period);
/// lander.register_untyped_subtask(|_job| (), SubtaskAttributes::named("descend"));
/// let modes = Modes::new();
/// modes.mode("landing", &[]);
/// modes.mode("landing", &[&lander]);
/// let error = finish_create_dags(&[lander]).unwrap_err();
/// assert_eq!(error.to_string(), "two modes are called `landing`; give each a name of its own");
/// assert_eq!(error.faults()[0].code(), "duplicate_mode");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WordedFault {
    pub(crate) code: &'static str,
    pub(crate) text: String,
}

impl fmt::Display for WordedFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}
