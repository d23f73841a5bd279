//! Why a test gives no bounds.

use core::fmt;

use super::pipelined::Unsolved;

/// Why a sufficient test did not prove a set of DAGs schedulable.
///
/// None of these says that the set is infeasible.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The set is outside the test's assumptions: there are no cores, or a
    /// deadline or priority is not of the kind the test is about.
    DoesNotApply,
    /// This DAG, by its position, has no bound within its relative deadline.
    Fails {
        /// The position of the DAG in the order given.
        position: usize,
    },
    /// The computation reached a limit on steps, on jobs in flight or on the
    /// size of numbers, at this DAG.
    Limit {
        /// The position of the DAG in the order given.
        position: usize,
    },
}

impl Unsolved {
    /// Names the DAG whose equation has no usable solution.
    pub(super) const fn at(self, position: usize) -> Refusal {
        match self {
            Self::BeyondDeadline => Refusal::Fails { position },
            Self::Limit => Refusal::Limit { position },
        }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::DoesNotApply => f.write_str("the test does not apply to these DAGs"),
            Self::Fails { position } => write!(
                f,
                "dag {position} has no bound within its relative deadline; \
                 give it more time, more cores or less interference"
            ),
            Self::Limit { position } => write!(
                f,
                "the analysis of dag {position} reached a limit; \
                 shorten its deadline in periods or use a coarser unit of time"
            ),
        }
    }
}

impl core::error::Error for Refusal {}
