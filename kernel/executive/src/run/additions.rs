//! The kernel as a platform that takes DAGs while others run.

use fass::{Additions, LaunchError, Plan};
use sched_dag::DagId;

use super::execution;
use super::platform::KERNEL;

/// Takes DAGs, and lets them go.
struct Adding;

/// Lets the DAGs of runs be changed from now on.
pub fn allow() {
    KERNEL.set_additions(&Adding);
}

impl Additions for Adding {
    fn add(&self, plan: Plan) -> Result<u64, LaunchError> {
        execution::add(plan)
    }

    fn remove(&self, plan: u64, dag: DagId) -> Result<(), LaunchError> {
        execution::remove(plan, dag)
    }

    fn counts(&self, _plan: u64, dag: DagId) -> bool {
        execution::counts(dag)
    }
}
