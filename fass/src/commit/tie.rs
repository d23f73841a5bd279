//! The fourth step of the commit: from verified DAGs to a plan.
//!
//! Edges get their rings, functions become bodies, signals learn their DAG, and parts tie
//! themselves. Everything has been verified, so no fault can be found any more.

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicU64, Ordering};

use sched_dag::{DagId, TaskSet};

use super::answer::CommitAnswers;
use crate::draft::part::{Drafts, Planner, TiedDag, one_of_each};
use crate::run::latest::{AnyLatest, Staleness};
use crate::run::plan::{Plan, SubtaskCode};
use crate::run::topic::DagWiring;

/// The plans made so far.
static PLANS: AtomicU64 = AtomicU64::new(0);

/// Turns verified DAGs into a plan, and closes their handles.
pub(crate) fn tie(
    drafts: &Drafts,
    task_set: Arc<TaskSet>,
    answers: &CommitAnswers,
    staleness: Arc<Vec<Staleness>>,
) -> Plan {
    let mut plan = Plan {
        task_set: Arc::clone(&task_set),
        // Counted from 1, so that 0 is no plan's number.
        number: PLANS.fetch_add(1, Ordering::Relaxed) + 1,
        bodies: Vec::with_capacity(drafts.len()),
        proven: answers.proven.clone(),
        answers: Box::new(Arc::clone(&answers.of_dags)),
        after_fault: alloc::vec![None; drafts.len()],
        lifecycle: None,
        staleness,
        lines: Vec::new(),
        begins: Vec::new(),
    };
    for (id, draft) in (0..).map(DagId).zip(drafts) {
        // From now on a handle that the app has kept names this DAG of this plan.
        draft.borrow().target.set(plan.number, id);
    }
    // Before the first draft is closed: samples, signals and modes cross DAGs.
    for (_, complete) in one_of_each::<Planner>(drafts) {
        complete(drafts, &mut plan);
    }
    let dags = drafts.iter().zip(task_set.dags());
    for ((draft, verified), after_fault) in dags.zip(&mut plan.after_fault) {
        let draft = draft.borrow_mut().close();
        let latest: Vec<_> = draft.all::<Rc<dyn AnyLatest>>().cloned().collect();
        let slots = usize::try_from(verified.in_flight()).unwrap_or(usize::MAX);
        let mut wiring = DagWiring::new(&draft.spec, &latest, slots);
        let make_bodies = draft.make_bodies.into_iter().enumerate();
        let bodies = make_bodies.map(|(subtask, make_body)| make_body(&mut wiring, subtask));
        let mut bodies: Vec<SubtaskCode> = bodies.collect();
        for (_, part) in draft.parts {
            part.tie(&mut TiedDag {
                verified,
                target: &draft.target,
                bodies: &mut bodies,
                after_fault,
            });
        }
        plan.bodies.push(bodies);
    }
    plan
}
