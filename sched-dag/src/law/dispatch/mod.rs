//! R5 for a journal: the changes that its events are. Each cluster is judged for itself.

use alloc::collections::{BTreeMap, BTreeSet};
use alloc::vec::Vec;
use core::ops::Range;

use super::replay::{stage_after, stage_before};
use super::sweep::{Change, Key, Ranking, Stage, Sweep, Waits, Wrong};
use super::{Terms, Violation};
use crate::ids::{CoreId, DagId, Instance};
use crate::journal::{Event, What};
use crate::policy::{OnFault, Policy, Preemption, SchedulerOptions};
use crate::task_set::TaskSet;

/// The model and the options of a run, and the cores of the cluster in hand.
struct Model<'a> {
    task_set: &'a TaskSet,
    options: &'a SchedulerOptions,
    cores: Range<u32>,
    /// When sporadic jobs were due.
    due_ns: BTreeMap<(DagId, u64), u64>,
}

impl Ranking for Model<'_> {
    /// Static priority: (priority, DAG, job, subtask). EDF: the deadline instead, that of
    /// the most urgent sink that the subtask reaches.
    fn key(&self, instance: Instance) -> Key {
        let Instance { dag, job, subtask } = instance;
        let model = self.task_set.dag(dag);
        let urgency = match self.options.policy {
            Policy::StaticPriority => model.subtask(subtask).priority().0.into(),
            Policy::Edf => {
                let due_ns = || self.due_ns.get(&(dag, job)).copied();
                let release_ns = match model.is_sporadic() {
                    true => due_ns().unwrap_or(u64::MAX),
                    false => model.grid_ns(job),
                };
                release_ns.saturating_add(model.subtask(subtask).relative_deadline_ns())
            }
        };
        (urgency, instance)
    }

    fn keeps_its_core(&self, instance: Instance) -> bool {
        let dag = self.task_set.dag(instance.dag);
        self.options.preemption == Preemption::Disabled
            || dag.subtask(instance.subtask).is_non_preemptive()
    }

    fn first_core(&self) -> u32 {
        self.cores.start
    }
}

/// What a journal shows of R5.
#[derive(Clone, Debug, Default)]
pub struct Dispatch {
    /// Every breach.
    pub violations: Vec<Violation>,
    /// How long instances waited.
    pub waits: Waits,
}

/// Holds a journal against R5: no instance is owed a core for longer than the terms
/// tolerate.
///
/// The events are in their order; one whose time is before that of an earlier one
/// counts as of that. If the oldest ones are lost, a core takes part from its first known
/// event on. An ended DAG's waiting instances are owed nothing.
#[must_use]
pub fn judge_dispatch(
    task_set: &TaskSet,
    options: &SchedulerOptions,
    terms: Terms,
    events: impl Iterator<Item = Event> + Clone,
) -> Dispatch {
    let first_ns = events.clone().next().map_or(0, |event| event.time_ns);
    let end_ns = events.clone().map(|event| event.time_ns).max().unwrap_or(0);
    let mut all = Dispatch::default();
    for cluster in task_set.clusters() {
        let is_of_it = |event: &Event| task_set.dag(event.dag).cluster() == cluster;
        let events = events.clone().filter(is_of_it);
        let due = events.clone().filter(|event| event.what == What::Due);
        let mut model = Model {
            task_set,
            options,
            cores: task_set.cores_of(cluster, options.cores),
            due_ns: BTreeMap::new(),
        };
        for event in due {
            model.due_ns.insert((event.dag, event.job), event.time_ns);
        }
        let Dispatch { violations, waits } = of_cluster(&model, terms, (first_ns, end_ns), events);
        all.violations.extend(violations);
        let ready_to_start_ns = waits.ready_to_start_ns;
        all.waits.ready_to_start_ns.extend(ready_to_start_ns);
        let longest_owed_ns = &mut all.waits.longest_owed_ns;
        *longest_owed_ns = waits.longest_owed_ns.max(*longest_owed_ns);
    }
    all
}

/// Judges the events of one cluster's DAGs, in a journal that begins and ends then.
fn of_cluster(
    model: &Model<'_>,
    terms: Terms,
    (first_ns, end_ns): (u64, u64),
    events: impl Iterator<Item = Event> + Clone,
) -> Dispatch {
    let Model {
        task_set, cores, ..
    } = model;
    let (mut known, before) = match terms.is_whole {
        true => (cores.clone().map(CoreId).collect(), Vec::new()),
        false => before(cores.clone(), events.clone()),
    };
    let known_at_first = known.len();
    let at_first = (0..known_at_first).map(|_| (first_ns, Change::CoreIsKnown));
    let before = before.into_iter().map(|change| (first_ns, change));
    let mut latest_ns = 0;
    let changes = events.clone().flat_map(|event| {
        latest_ns = event.time_ns.max(latest_ns);
        let is_new = event.what.is_of_machine() && known.insert(event.core);
        let ends_its_dag = task_set.dag(event.dag).on_fault() == OnFault::EndDag;
        let stops = match event.what {
            What::Stopped => true,
            What::Ended => ends_its_dag,
            _ => false,
        };
        let stage = event.instance().filter(|_| event.what != What::Request);
        let changes = [
            is_new.then_some(Change::CoreIsKnown),
            stops.then_some(Change::Stopped(event.dag)),
            stage.map(|instance| Change::Stage(instance, stage_after(&event))),
        ];
        let changes = changes.into_iter().flatten();
        changes.map(move |change| (latest_ns, change))
    });
    let changes = at_first.chain(before).chain(changes);
    let (wrong, waits) = Sweep::judge(model, terms.tolerance_ns, changes, end_ns);
    let mut violations: Vec<Violation> = wrong.into_iter().map(Violation::PassedOver).collect();
    if terms.tolerance_ns == 0 {
        violations.extend(chosen_wrongly(model, events.clone()));
    }
    violations.extend(wrong_cores(model, events));
    Dispatch { violations, waits }
}

/// Returns the breaches that [`judge_dispatch`] finds.
#[must_use]
pub fn dispatch_violations(
    task_set: &TaskSet,
    options: &SchedulerOptions,
    terms: Terms,
    events: impl Iterator<Item = Event> + Clone,
) -> Vec<Violation> {
    judge_dispatch(task_set, options, terms, events).violations
}

/// Returns what must have been the case before the first event: which cores were busy,
/// or idle with something else's end to come, and what each instance was.
fn before(
    cores: Range<u32>,
    events: impl Iterator<Item = Event>,
) -> (BTreeSet<CoreId>, Vec<Change>) {
    let mut first_of_core: BTreeMap<CoreId, What> = BTreeMap::new();
    let mut first_of_instance: BTreeMap<Instance, Stage> = BTreeMap::new();
    for event in events.filter(|event| event.what != What::Request) {
        if let Some(instance) = event.instance() {
            let stage = first_of_instance.entry(instance);
            stage.or_insert_with(|| stage_before(&event));
        }
        if event.what.is_of_machine() {
            first_of_core.entry(event.core).or_insert(event.what);
        }
    }
    let is_busy = |what: &What| !matches!(what, What::Start | What::Resume);
    let busy = cores.map(CoreId);
    let busy = busy.filter(|core| first_of_core.get(core).is_some_and(is_busy));
    let stages = first_of_instance.into_iter();
    let stages = stages.filter(|(_, stage)| *stage != Stage::Absent);
    (
        busy.collect(),
        stages.map(|(it, stage)| Change::Stage(it, stage)).collect(),
    )
}

/// Returns what started and keeps its core, although one that goes first had been ready
/// before in the same instant and got none. Only exact times tell: on a machine the one
/// may have become ready when the other was chosen already.
fn chosen_wrongly(model: &Model<'_>, events: impl Iterator<Item = Event>) -> Vec<Violation> {
    let mut fresh: BTreeSet<Key> = BTreeSet::new();
    // The one that goes first, and the start of the other one.
    let mut passed: Vec<(Key, Event)> = Vec::new();
    let mut found = Vec::new();
    let mut now_ns = 0;
    for event in events {
        if event.time_ns > now_ns {
            now_ns = event.time_ns;
            found.append(&mut passed);
            fresh.clear();
        }
        let Some(instance) = event.instance() else {
            continue;
        };
        let key = model.key(instance);
        match event.what {
            What::Ready => {
                fresh.insert(key);
            }
            What::Start => {
                fresh.remove(&key);
                passed.retain(|(first, ..)| *first != key);
                let first = fresh.first().filter(|first| **first < key);
                if let Some(first) = first
                    && model.keeps_its_core(instance)
                {
                    passed.push((*first, event));
                }
            }
            What::Cancelled => {
                fresh.remove(&key);
                passed.retain(|(first, ..)| *first != key);
            }
            _ => {}
        }
    }
    found.extend(passed);
    let wrong = |(first, event): (Key, Event)| {
        event.instance().map(|started| Wrong::OutOfTurn {
            started,
            core: event.core,
            at_ns: event.time_ns,
            first: first.1,
            since_ns: event.time_ns,
        })
    };
    let found = found.into_iter().filter_map(wrong);
    found.map(Violation::PassedOver).collect()
}

/// Returns what was on a core of another cluster, or lost a core that it keeps.
fn wrong_cores(model: &Model<'_>, events: impl Iterator<Item = Event>) -> Vec<Violation> {
    let found = events.filter_map(|event| {
        if event.what.is_of_machine() && !model.cores.contains(&event.core.0) {
            return Some(Violation::OutsideItsCluster { event });
        }
        let lost = event.what == What::Resume && model.keeps_its_core(event.instance()?);
        lost.then_some(Violation::LostItsCore { event })
    });
    found.collect()
}

#[cfg(test)]
pub(super) mod tests;
