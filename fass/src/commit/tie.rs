//! The third step of the commit: from verified DAGs to a plan.
//!
//! Edges get their rings, functions become bodies, signals learn their DAG, and
//! latest values get their writers. All has been verified, so nothing can fail.

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::sync::atomic::{AtomicU64, Ordering};

use sched_dag::{Activation, DagId, OnFault, SubtaskSpec, TaskSet};

use super::answer::CommitAnswers;
use crate::draft::DagDraft;
use crate::draft::checks::{Drafts, writer_of};
use crate::run::latest::Staleness;
use crate::run::plan::{Plan, SubtaskCode};
use crate::run::record::{AnyRecorded, OfDag, SampledValue};
use crate::run::subtask::MakeBody;
use crate::run::topic::DagWiring;

/// The plans made so far.
static PLANS: AtomicU64 = AtomicU64::new(0);

/// Turns verified DAGs into a plan, and closes their handles.
#[allow(
    clippy::too_many_lines,
    reason = "ties parts that are all in hand only here"
)]
pub(crate) fn tie(
    drafts: &Drafts,
    task_set: Arc<TaskSet>,
    answers: &CommitAnswers,
    staleness: Arc<Vec<Staleness>>,
) -> Plan {
    // Counted from 1, so that 0 is no plan's number.
    let number = PLANS.fetch_add(1, Ordering::Relaxed) + 1;
    // Out of all drafts before the first is closed: samples cross DAGs.
    let recorded = (drafts.iter()).map(|draft| core::mem::take(&mut draft.borrow_mut().recorded));
    let recorded: Vec<Vec<Rc<dyn AnyRecorded>>> = recorded.collect();
    let any = recorded.iter().flatten().next();
    let samples = drafts
        .iter()
        .map(|draft| samples(drafts, &draft.borrow(), &recorded));
    let samples: Vec<Vec<SampledValue>> = samples.collect();
    // What serves the requests of the DAGs, if there can be any.
    let lifecycle = drafts.iter().find_map(|draft| draft.borrow().lifecycle);
    let lifecycle = lifecycle.map(|make| make(drafts));
    let mut lines = Vec::new();
    let bodies = ((0..)
        .map(DagId)
        .zip(drafts)
        .zip(task_set.dags())
        .zip(&recorded))
    .map(|(((id, draft), verified), of_dag)| {
        let draft = draft.borrow_mut().close();
        let (spec, latest) = (draft.spec, draft.latest);
        // From now on a handle that the app has kept names this DAG of this plan.
        draft.target.set(number, id);
        if spec.activation == Activation::Sporadic {
            let tell = |tell: Box<dyn FnOnce(_)>| tell(Arc::clone(&draft.target));
            draft.receives.into_iter().for_each(tell);
        }
        // Channels are numbered before bodies are made: a tap is made only of an open channel.
        let around = any.map(|any| {
            let of_dag = OfDag {
                dag: id,
                spec: &spec,
                order: verified.topological_order(),
                recorded: of_dag,
                samples: &samples[id.index()],
                devices: &draft.devices,
                states: &draft.states,
            };
            any.open_all(&of_dag, &mut lines)
        });
        let slots = usize::try_from(verified.in_flight()).unwrap_or(usize::MAX);
        let faults = match verified.on_fault() {
            OnFault::EndDag => 0,
            OnFault::DropJob(limit) => limit.in_all,
        };
        draft
            .resets
            .into_iter()
            .for_each(|provide| provide.1(faults));
        let mut wiring = DagWiring::new(&spec, &latest, slots);
        let make = |(subtask, make_body): (usize, MakeBody)| -> SubtaskCode {
            let any = of_dag.first();
            any.and_then(|any| any.source(of_dag, &spec, &mut wiring, subtask))
                .unwrap_or_else(|| make_body(&mut wiring, subtask))
        };
        let mut bodies: Vec<SubtaskCode> = draft
            .make_bodies
            .into_iter()
            .enumerate()
            .map(make)
            .collect();
        // In the order of registration, which is that in which a completion carries them out.
        for (subtask, effect) in draft.effects {
            bodies[subtask].add_effects([effect]);
        }
        for latest in &latest {
            let writes = |subtask: &SubtaskSpec| {
                (subtask.outputs.iter()).any(|port| port.topic == latest.topic())
            };
            if let Some(writer) = spec.subtasks.iter().position(writes) {
                bodies[writer].add_effects(latest.effects());
            }
        }
        // Last, so that what is put around a body is around all that it does.
        if let (Some(any), Some(around)) = (any, around) {
            any.attach(around, &mut bodies);
        }
        bodies.iter_mut().for_each(SubtaskCode::hold_effects);
        bodies
    })
    .collect();
    let handler = |draft: &Rc<RefCell<DagDraft>>| Some(draft.borrow().on_fault.as_ref()?.get()?.1);
    Plan {
        task_set,
        number,
        bodies,
        proven: answers.proven.clone(),
        answers: Box::new(Arc::clone(&answers.of_dags)),
        after_fault: drafts.iter().map(handler).collect(),
        lifecycle,
        staleness,
        lines,
        begins: Vec::new(),
    }
}

/// Returns the samples of recorded topics that a DAG's subtasks take.
fn samples(
    drafts: &Drafts,
    draft: &DagDraft,
    recorded: &[Vec<Rc<dyn AnyRecorded>>],
) -> Vec<SampledValue> {
    let samples = draft
        .samples
        .iter()
        .filter_map(|(subtask, latest, sampler)| {
            let writer = writer_of(drafts, latest)?;
            let mut topics = recorded[writer].iter();
            Some(SampledValue {
                subtask: *subtask,
                latest: Rc::clone(latest),
                sampler: *sampler,
                of: Rc::clone(topics.find(|topic| topic.topic() == latest.topic())?),
            })
        });
    samples.collect()
}
