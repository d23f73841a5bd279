//! A set in the real scheduler, through commit and virtual time.

use std::sync::Arc;

use sched_dag::virtual_time::{End, VirtualTime};
use sched_dag::{CommitOptions, ConstructionPolicy, DagId, Scheduler, verify};

use crate::Outcome;
use crate::record::Record;
use crate::set::Set;

/// Runs a set and returns what happened, or why that contradicts itself.
pub(crate) fn replay(set: &Set) -> Result<Outcome, String> {
    let mut record = Record::new(set);
    let mut run = VirtualTime::new(scheduler(set)?);
    if run.run(&mut record) != End::Finished {
        return Err("the run does not finish".to_owned());
    }
    record.finish(run.scheduler_of(DagId(0)))
}

pub(crate) fn scheduler(set: &Set) -> Result<Scheduler, String> {
    let options = CommitOptions::new(set.options.policy, set.options.cores)
        .with_construction(ConstructionPolicy::any_graph());
    let verified = verify(&set.specs(), &options).map_err(|rejected| rejected.to_string())?;
    let task_set = Arc::new(verified.task_set);
    Ok(Scheduler::new(task_set, set.options))
}
