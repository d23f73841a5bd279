//! The commit's own division of a platform's cores, for platforms that leave it that.

use alloc::format;

use sched_dag::TaskSet;
use sched_dag::analysis::{self, NotAssigned};

use crate::platform::{LaunchError, Platform};

/// Divides a platform's cores for a task set, as [`sched_dag::analysis::assign()`] does: what
/// [`Platform::assign`] is to do, if the commit may.
///
/// # Errors
///
/// In words: which DAG gets no cores, and why.
///
/// ```
/// use fass::{LaunchError, Platform, assign_clusters};
/// use sched_dag::TaskSet;
///
/// /// The `assign` of a platform that always leaves it to the commit.
/// fn assign(platform: &dyn Platform, task_set: &mut TaskSet) -> Result<(), LaunchError> {
///     assign_clusters(platform, task_set)
/// }
/// ```
pub fn assign_clusters(platform: &dyn Platform, task_set: &mut TaskSet) -> Result<(), LaunchError> {
    analysis::assign(task_set, &platform.terms().settings()).map_err(
        |NotAssigned { dag, reason }| {
            let dag = task_set.label(dag);
            LaunchError::new(format!("{dag} gets no cores: {reason}"))
        },
    )
}
