//! What a platform offers that takes DAGs while others run.

use sched_dag::DagId;

use super::LaunchError;
use crate::run::plan::Plan;

/// Takes DAGs during a run, and lets them go ([`Platform::additions`](crate::Platform::additions)).
/// The rules are A1 to A6 of `sched-dag/src/scheduler/adding.rs`.
///
/// See [`Commit::add`](crate::Commit::add).
pub trait Additions {
    /// Takes DAGs to those of the plan of the same number, and returns when their time begins:
    /// in nanoseconds from the beginning of the run.
    ///
    /// The plan has the model, the bodies and what follows faults of the added DAGs only; their
    /// numbers count on from the last DAG that there is. Its bounds are of all DAGs, as they hold
    /// from now on.
    ///
    /// # Errors
    ///
    /// If the platform cannot schedule them. Nothing has changed then.
    fn add(&self, plan: Plan) -> Result<u64, LaunchError>;

    /// Closes a DAG of the plan of a number, and gives back what it holds once it is over (A5).
    /// Does nothing if that is under way.
    ///
    /// # Errors
    ///
    /// If the plan is not, or no longer, there.
    fn remove(&self, plan: u64, dag: DagId) -> Result<(), LaunchError>;

    /// Reports whether a DAG of the plan of a number counts in a proof that is made now: unless
    /// it is removed, and what it may have delayed is over (A6).
    fn counts(&self, plan: u64, dag: DagId) -> bool;
}
