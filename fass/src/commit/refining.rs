//! Whether the platform can cut refinements, where there are such.

use alloc::vec::Vec;

use sched_dag::DagId;

use super::fault::Fault;
use crate::api::dag::Dag;

/// Returns the faults, and with them why the platform does not take these DAGs, if one of them
/// refines.
pub(super) fn with_refusal(dags: &[Dag], mut faults: Vec<Fault>) -> Vec<Fault> {
    let refusal_of = |(id, dag): (DagId, &Dag)| {
        let draft = dag.draft.borrow();
        // Called by a pointer: an image without such DAGs has nothing of it.
        let (subtask, check) = draft.refines?;
        check(&draft, subtask, id).err()
    };
    let refusal = (0..).map(DagId).zip(dags).find_map(refusal_of);
    faults.extend(refusal.map(Fault::NotLaunched));
    faults
}
