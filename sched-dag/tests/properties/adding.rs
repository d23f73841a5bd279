//! DAGs that come one after another, compared with a set that has all from the beginning.

use std::sync::Arc;

use sched_dag::virtual_time::{End, VirtualTime};
use sched_dag::{CommitOptions, ConstructionPolicy, DagId, DagSpec, Scheduler, TaskSet, verify};

use crate::random::Random;
use crate::record::Record;
use crate::set::Set;
use crate::{Outcome, first_difference, reference};

/// Returns the first difference between a run in which all DAGs but the first are added, and the
/// reference of the whole set.
pub(crate) fn difference(set: &Set) -> Option<String> {
    match add_one_by_one(set) {
        Ok(happened) => first_difference(&reference::simulate(set), &happened),
        Err(reason) => Some(reason),
    }
}

fn add_one_by_one(set: &Set) -> Result<Outcome, String> {
    let mut random = Random::new(set.choices);
    let mut record = Record::new(set);
    let specs = set.specs();
    let mut task_set = commit(set, &specs[..1])?;
    let mut run = VirtualTime::new(Scheduler::new(Arc::clone(&task_set), set.options));
    let mut now_ns = 0;
    for spec in &specs[1..] {
        // At the latest at its first release; several may come at once.
        let at_ns = random.between(now_ns, spec.offset_ns);
        if at_ns > now_ns
            && let End::TimeOverflow(_) | End::Stopped = run.run_until(at_ns - 1, &mut record)
        {
            return Err("the run does not go on".to_owned());
        }
        now_ns = at_ns;
        let offset_ns = spec.offset_ns - at_ns;
        let added = commit(
            set,
            &[DagSpec {
                offset_ns,
                ..spec.clone()
            }],
        )?;
        task_set = Arc::new(task_set.with_added(&added, at_ns));
        run.extend(&task_set);
    }
    if run.run(&mut record) != End::Finished {
        return Err("the run does not finish".to_owned());
    }
    record.finish(run.scheduler_of(DagId(0)))
}

fn commit(set: &Set, specs: &[DagSpec]) -> Result<Arc<TaskSet>, String> {
    let options = CommitOptions::new(set.options.policy, set.options.cores)
        .with_construction(ConstructionPolicy::any_graph());
    let verified = verify(specs, &options).map_err(|rejected| rejected.to_string())?;
    Ok(Arc::new(verified.task_set))
}
