//! DAGs that are added to a run of this thread's machine, and removed.

use fass::{Additions, LaunchError, Plan};
use sched_dag::DagId;

use crate::platform::{HostPlatform, current};
use crate::session::Session;
use crate::surroundings::Surroundings;

impl Additions for HostPlatform {
    fn add(&self, plan: Plan) -> Result<u64, LaunchError> {
        let number = plan.number;
        with(number, |session, machine| session.add(plan, machine))?
    }

    fn remove(&self, plan: u64, dag: DagId) -> Result<(), LaunchError> {
        with(plan, |session, machine| session.remove(dag, machine))
    }

    fn counts(&self, plan: u64, dag: DagId) -> bool {
        // Of a run that is not there, what is said does not matter.
        with(plan, |session, _| session.counts(dag)).unwrap_or(true)
    }
}

/// Does something with the run of a plan, between two calls of `run`.
fn with<T>(
    plan: u64,
    act: impl FnOnce(&mut Session, &Surroundings) -> T,
) -> Result<T, LaunchError> {
    let machine = current().filter(|machine| machine.plan.get() == Some(plan));
    let done = machine.and_then(|machine| {
        let mut session = machine.session.borrow_mut();
        Some(act(session.as_mut()?, &machine.surroundings))
    });
    done.ok_or_else(|| {
        LaunchError::new(
            "the commit is not of this thread's newest `VirtualTime`, or that is in the middle of \
             its run; change the DAGs of a run between two calls of `run_for`",
        )
    })
}
