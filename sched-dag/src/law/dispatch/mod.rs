//! Judges a journal by R5, and T1 to T4: turns its events into changes of the dispatch, cluster by
//! cluster.

use alloc::collections::{BTreeMap, BTreeSet};
use alloc::vec::Vec;
use core::ops::Range;

use super::lives::{stage_after, stage_before};
use super::sweep::{DispatchModel, DispatchState, DispatchSweep, Place, WaitCounts};
use super::tables::CoreLists;
use super::{JudgeOptions, Violation};
use crate::ids::{CoreId, Instance};
use crate::journal::{Event, EventKind};
use crate::policies::SchedulerOptions;
use crate::policy::OnFault;
use crate::task_set::{Dag, TaskSet};

/// The findings about R5 and T1 to T4 in a journal.
#[derive(Clone, Debug, Default)]
pub struct DispatchReport {
    /// Every breach.
    pub violations: Vec<Violation>,
    /// How long instances waited.
    pub waits: WaitCounts,
}

/// Checks a journal against R5, and T1 to T4: no instance is owed a core for longer than `terms`
/// tolerate.
///
/// The events must be in their order; an event with an earlier time than its predecessor counts at
/// the predecessor's time. If the oldest events are lost, a core takes part from its first known
/// event on. Waiting instances of an ended DAG are owed nothing.
#[must_use]
pub fn judge_dispatch(
    task_set: &TaskSet,
    options: &SchedulerOptions,
    terms: JudgeOptions,
    events: impl Iterator<Item = Event> + Clone,
) -> DispatchReport {
    let first_ns = events.clone().next().map_or(0, |event| event.time_ns);
    let end_ns = events.clone().map(|event| event.time_ns).max().unwrap_or(0);
    let mut all = DispatchReport::default();
    for cluster in task_set.clusters() {
        let is_of_it = |event: &Event| task_set.dag(event.dag).cluster() == cluster;
        let events = events.clone().filter(is_of_it);
        let due = events.clone().filter(|event| event.what == EventKind::Due);
        let own = task_set
            .dags()
            .iter()
            .filter(|dag| dag.cluster() == cluster);
        let groups: BTreeSet<&[u32]> = own.map(Dag::affinity).collect();
        let cores = task_set.cores_of(cluster, options.cores);
        let mut model = DispatchModel {
            task_set,
            options,
            numbers: (task_set.dags().iter())
                .map(|dag| options.policy.numbers(dag))
                .collect(),
            groups: groups.into_iter().collect(),
            lists: CoreLists::new(task_set, &cores, options.cores),
            cores,
            due_ns: BTreeMap::new(),
        };
        for event in due {
            model.due_ns.insert((event.dag, event.job), event.time_ns);
        }
        of_cluster(&model, terms, (first_ns, end_ns), events, &mut all);
    }
    all
}

/// Judges the events of one cluster's DAGs, in a journal from `first_ns` to `end_ns`.
fn of_cluster(
    model: &DispatchModel<'_>,
    terms: JudgeOptions,
    (first_ns, end_ns): (u64, u64),
    events: impl Iterator<Item = Event> + Clone,
    DispatchReport { violations, waits }: &mut DispatchReport,
) {
    let cores = model.cores.clone();
    let (known, before) = match terms.is_whole {
        true => (cores.map(CoreId).collect(), BTreeMap::new()),
        false => before(cores, events.clone()),
    };
    let mut sweep = DispatchSweep::new(model, terms, first_ns, waits);
    // A core not yet named by an event may have run anything, so nothing is held against it.
    sweep.known_cores = known;
    for (instance, stage) in before {
        sweep.enter(instance, stage);
    }
    for event in events.clone() {
        sweep.go_on_to(event.time_ns);
        if event.what.is_of_machine() {
            sweep.known_cores.insert(event.core);
        }
        violations.extend(sweep.take_entry(&event));
        // The end of an instance also ends its DAG, unless the DAG survives faults.
        let ends_its_dag = model.task_set.dag(event.dag).on_fault() == OnFault::EndDag;
        if event.what == EventKind::DagEnded || event.what == EventKind::Ended && ends_its_dag {
            sweep.end_dag(event.dag);
        }
        if let Some(instance) = event
            .instance()
            .filter(|_| event.what != EventKind::Request)
        {
            sweep.enter(instance, stage_after(&event));
        }
    }
    let wrong = sweep.finish(end_ns);
    violations.extend(wrong.into_iter().map(Violation::PassedOver));
    violations.extend(wrong_cores(model, events));
}

/// Returns the breaches found by [`judge_dispatch`].
#[must_use]
pub fn dispatch_violations(
    task_set: &TaskSet,
    options: &SchedulerOptions,
    terms: JudgeOptions,
    events: impl Iterator<Item = Event> + Clone,
) -> Vec<Violation> {
    judge_dispatch(task_set, options, terms, events).violations
}

/// Returns the state before the first event: the cores that were busy, or idle with the end of
/// another core's instance as their first event; and the state of each instance.
fn before(
    cores: Range<u32>,
    events: impl Iterator<Item = Event>,
) -> (BTreeSet<CoreId>, BTreeMap<Instance, DispatchState>) {
    let mut first_of_core: BTreeMap<CoreId, EventKind> = BTreeMap::new();
    let mut first_of_instance: BTreeMap<Instance, DispatchState> = BTreeMap::new();
    for event in events.filter(|event| event.what != EventKind::Request) {
        if let Some(instance) = event.instance() {
            let stage = first_of_instance.entry(instance);
            stage.or_insert_with(|| stage_before(&event));
        }
        if event.what.is_of_machine() {
            first_of_core.entry(event.core).or_insert(event.what);
        }
    }
    let is_busy = |what: &EventKind| !matches!(what, EventKind::Start | EventKind::Resume);
    let busy = cores.map(CoreId);
    let busy = busy.filter(|core| first_of_core.get(core).is_some_and(is_busy));
    (busy.collect(), first_of_instance)
}

/// Returns breaches by instances on a core forbidden by cluster, table or affinity, and by
/// instances that lost a core they keep.
fn wrong_cores(model: &DispatchModel<'_>, events: impl Iterator<Item = Event>) -> Vec<Violation> {
    let mut suspended = BTreeSet::new();
    let found = events.filter_map(|event| {
        if event.what.is_of_machine() && !model.cores.contains(&event.core.0) {
            return Some(Violation::OutsideItsCluster { event });
        }
        if event.what.is_of_machine()
            && let Some(of) = event.instance()
        {
            match model.place(of) {
                Place::Core(core) if core != event.core => {
                    return Some(Violation::OffItsCore { event, core });
                }
                Place::Group(group) if !model.is_of(group, event.core) => {
                    return Some(Violation::OutsideItsAffinity { event });
                }
                _ => {}
            }
        }
        let instance = (event.instance()).filter(|of| model.keeps_its_core(*of))?;
        let lost = match event.what {
            EventKind::Suspend => {
                suspended.insert(instance);
                false
            }
            // An instance also resumes after a wait, on any core, since the wait gave up its core
            // (W5).
            EventKind::Resume => {
                let dag = model.task_set.dag(instance.dag);
                dag.subtask(instance.subtask).waits().is_empty() || suspended.remove(&instance)
            }
            _ => false,
        };
        lost.then_some(Violation::LostItsCore { event })
    });
    found.collect()
}

#[cfg(test)]
pub(super) mod tests;
