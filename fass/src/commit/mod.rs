//! The commit: its options, its answers and its faults.
//!
//! Most apps need only [`finish_create_dags`](crate::finish_create_dags).
//!
//! - Options: other shapes of graphs, by [`finish_create_dags_with`], and lists of cores, by
//!   [`finish_create_dags_in_order`].
//! - Answers: a [`Commit`] has warnings, a [`DagAnswer`] for each DAG with its proven bound or the
//!   reason for the lack of a bound, and the greatest age of sampled values ([`Staleness`]).
//! - Faults: a [`CommitError`] has every [`Fault`] of every DAG.

pub(crate) mod answer;
pub(crate) mod finish;
mod tie;

pub use answer::{
    ClusterPlacement, Commit, DagAnswer, EndToEnd, SinkAnswer, TablePlacement, Verdict,
};
pub use finish::{finish_create_dags_in_order, finish_create_dags_with};
pub use sched_dag::analysis::{NotProvenReason, OverheadSource, Overheads, SchedulabilityTest};
pub use sched_dag::wcets::{WcetFault, WcetSource};
pub use sched_dag::{
    AssignmentReason, ClusterId, ConstructionPolicy, CoreDivision, CountLimit, Warning,
};

pub use crate::draft::fault::{CommitError, Fault, UnprovenDag};
pub use crate::run::latest::Staleness;
