//! Graham's bound: one DAG, dedicated cores.
//!
//! R. L. Graham, "Bounds on multiprocessing timing anomalies", SIAM J. Applied
//! Mathematics 17(2), 1969, doi:10.1137/0117039:
//! `R = length + (volume - length) / m`.
//!
//! Assumes a work-conserving scheduler in any order, preemptive or not, and one
//! job alone on the cores (so `R <= T`, or nothing else released meanwhile).
//!
//! Trap: a simulation with WCETs is not a test. Graham's own example finishes
//! *later* when every subtask gets shorter, cores are added or edges removed;
//! the bound covers all of these, the simulation covers none.

use super::task::Task;

/// Returns Graham's bound on the response time of one job alone on `cores`
/// cores, or `None` without cores.
#[must_use]
pub fn graham(task: &Task, cores: u32) -> Option<u64> {
    let beside = task.volume_ns() - task.length_ns();
    // At most the volume, so it cannot overflow.
    Some(task.length_ns() + beside.checked_div(u64::from(cores))?)
}
